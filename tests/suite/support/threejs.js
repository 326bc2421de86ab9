// Spheres lit by environments that Kiln baked, rendered by three.js: radiance before tone mapping, as floats.
//
// scenes.json: [{ name, cube, size, color, metalness, roughness }], cubes being KTX2 files of half floats; or, of a matt sphere, an sh.json.
import * as THREE from 'three';
import { read } from 'three/addons/libs/ktx-parse.module.js';

const renderer = new THREE.WebGLRenderer();

// three.js' own KTX2 loader shows raw cubes black; handed over like this, it takes them.
async function cube(file) {
    const { levels, pixelWidth } = read(new Uint8Array(await bytes(file)));
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
