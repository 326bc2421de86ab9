// Spheres lit by environments that Kiln baked, rendered by three.js: radiance before tone mapping, as floats.
//
// scenes.json: [{ name, cube, size, color, metalness, roughness }], cubes being KTX2 files of half floats or of UASTC HDR; or, of a matt sphere,
// an sh.json. Of each file of UASTC HDR, FILE-halves and FILE-bc6h are what the loader's transcoder makes of it, level by level.
import * as THREE from 'three';
import { read } from 'three/addons/libs/ktx-parse.module.js';
import { KTX2Loader } from 'three/addons/loaders/KTX2Loader.js';

const renderer = new THREE.WebGLRenderer();
const loader = new KTX2Loader().detectSupport(renderer);
const loaded = {};

// What the loader hands to the machine, as it is.
async function own(file) {
    if (loaded[file]) return loaded[file];
    for (const [kind, bptcSupported, format] of [
        ['halves', false, THREE.RGBAFormat],
        ['bc6h', true, THREE.RGB_BPTC_UNSIGNED_Format],
    ]) {
        const apart = new KTX2Loader();
        apart.workerConfig = { bptcSupported };
        const texture = await apart.loadAsync('/' + file);
        if (!texture.isCompressedCubeTexture || texture.format !== format) throw new Error(`${file}: no cube of ${kind}`);
        const faces = texture.image;
        const parts = faces[0].mipmaps.flatMap((_, level) => faces.map(({ mipmaps }) => mipmaps[level].data));
        await post(file.replace('/', '-') + '-' + kind, new Blob(parts));
        apart.dispose();
    }
    loaded[file] = await loader.loadAsync('/' + file);
    loaded[file].isPMREMTexture = true;
    return loaded[file];
}

// three.js' own KTX2 loader shows raw cubes black; handed over like this, it takes them.
async function cube(file) {
    const { levels, pixelWidth, dataFormatDescriptor } = read(new Uint8Array(await bytes(file)));
    if (dataFormatDescriptor[0].colorModel === 167) return own(file);
    const faces = [0, 1, 2, 3, 4, 5].map((face) => {
        const mipmaps = levels.map(({ levelData }, level) => {
            const width = pixelWidth >> level;
            const n = 4 * width * width;
            const data = new Uint16Array(levelData.slice().buffer).subarray(face * n, (face + 1) * n);
            return { data, width, height: width };
        });
        return { width: pixelWidth, height: pixelWidth, mipmaps };
    });
    const texture = new THREE.CompressedCubeTexture(faces, THREE.RGBAFormat, THREE.HalfFloatType);
    texture.minFilter = THREE.LinearMipmapLinearFilter;
    texture.magFilter = THREE.LinearFilter;
    texture.isPMREMTexture = true;
    texture.needsUpdate = true;
    return texture;
}

const scenes = JSON.parse(new TextDecoder().decode(await bytes('scenes.json')));
for (const { name, cube: file, size, color, metalness, roughness } of scenes) {
    const scene = new THREE.Scene();
    let material;
    if (file.endsWith('.json')) {
        const { engine } = JSON.parse(new TextDecoder().decode(await bytes(file)));
        const probe = new THREE.LightProbe();
        probe.sh.fromArray(engine.coefficients.flat());
        scene.add(probe);
        material = new THREE.MeshLambertMaterial({ color: new THREE.Color(color, color, color) });
    } else {
        scene.environment = await cube(file);
        material = new THREE.MeshStandardMaterial({ color: new THREE.Color(color, color, color), metalness, roughness });
    }
    scene.add(new THREE.Mesh(new THREE.SphereGeometry(1, 256, 128), material));
    const camera = new THREE.OrthographicCamera(-1, 1, 1, -1, 0, 4);
    camera.position.z = 2;
    const target = new THREE.WebGLRenderTarget(size, size, { type: THREE.FloatType });
    renderer.setRenderTarget(target);
    renderer.render(scene, camera);
    const pixels = new Float32Array(4 * size * size);
    renderer.readRenderTargetPixels(target, 0, 0, size, size, pixels);
    await post(name, pixels);
}
await done();
