// Spheres lit by KTX1 files that Kiln wrote, loaded and rendered by Filament's web build: radiance before tone mapping, as floats.
//
// scenes.json: [{ name, cube, table, size, color, metalness, roughness }]; tables are not replaced.
await new Promise((loaded, failed) => {
    const script = document.createElement('script');
    [script.src, script.onload, script.onerror] = ['/tools/filament/filament.js', loaded, () => failed(new Error('no Filament'))];
    document.head.append(script);
});
await new Promise((ready) => Filament.init([], ready));

const scenes = JSON.parse(new TextDecoder().decode(await bytes('scenes.json')));
const { size } = scenes[0];
const canvas = document.createElement('canvas');
[canvas.width, canvas.height] = [size, size];
const gl = canvas.getContext('webgl2', { majorVersion: 2, minorVersion: 0, antialias: false, depth: true, alpha: false });
gl.getExtension('EXT_color_buffer_float');
// What is drawn on the canvas is kept in floats instead.
const kept = gl.createFramebuffer();
gl.bindFramebuffer(gl.FRAMEBUFFER, kept);
for (const [attachment, format] of [[gl.COLOR_ATTACHMENT0, gl.RGBA32F], [gl.DEPTH_ATTACHMENT, gl.DEPTH_COMPONENT24]]) {
    const buffer = gl.createRenderbuffer();
    gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
    gl.renderbufferStorage(gl.RENDERBUFFER, format, size, size);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, attachment, gl.RENDERBUFFER, buffer);
}
const bind = gl.bindFramebuffer.bind(gl);
gl.bindFramebuffer = (target, framebuffer) => bind(target, framebuffer || kept);

// A sphere as glTF has it: positions, which are its normals, and triangles.
function sphere(color, metallic, roughness) {
    const [columns, rows] = [192, 96];
    const points = [], triangles = [];
    for (let j = 0; j <= rows; j++) {
        for (let i = 0; i <= columns; i++) {
            const [phi, theta] = [2 * Math.PI * i / columns, Math.PI * j / rows];
            points.push(Math.sin(theta) * Math.sin(phi), Math.cos(theta), Math.sin(theta) * Math.cos(phi));
            const at = j * (columns + 1) + i;
            if (i < columns && j < rows) triangles.push(at, at + columns + 1, at + 1, at + 1, at + columns + 1, at + columns + 2);
        }
    }
    const binary = new Uint8Array([...new Uint8Array(new Float32Array(points).buffer), ...new Uint8Array(new Uint32Array(triangles).buffer)]);
    const [n, length] = [points.length / 3, 4 * points.length];
    const json = JSON.stringify({
        asset: { version: '2.0' }, scene: 0, scenes: [{ nodes: [0] }], nodes: [{ mesh: 0 }],
        meshes: [{ primitives: [{ attributes: { POSITION: 0, NORMAL: 0 }, indices: 1, material: 0 }] }],
        materials: [{ pbrMetallicRoughness: { baseColorFactor: [color, color, color, 1], metallicFactor: metallic, roughnessFactor: roughness } }],
        accessors: [
            { bufferView: 0, componentType: 5126, count: n, type: 'VEC3', min: [-1, -1, -1], max: [1, 1, 1] },
            { bufferView: 1, componentType: 5125, count: triangles.length, type: 'SCALAR' },
        ],
        bufferViews: [{ buffer: 0, byteLength: length }, { buffer: 0, byteOffset: length, byteLength: binary.length - length }],
        buffers: [{ byteLength: binary.length }],
    });
    const text = new TextEncoder().encode(json + ' '.repeat(-json.length & 3));
    const file = new Uint8Array(28 + text.length + binary.length);
    const words = new DataView(file.buffer);
    [0x46546C67, 2, file.length, text.length, 0x4E4F534A].forEach((word, i) => words.setUint32(4 * i, word, true));
    file.set(text, 20);
    [binary.length, 0x004E4942].forEach((word, i) => words.setUint32(20 + text.length + 4 * i, word, true));
    file.set(binary, 28 + text.length);
    return file;
}

const engine = Filament.Engine.create(canvas);
const [swapChain, renderer, view, scene] = [engine.createSwapChain(), engine.createRenderer(), engine.createView(), engine.createScene()];
const camera = engine.createCamera(Filament.EntityManager.get().create());
camera.setProjection(Filament.Camera$Projection.ORTHO, -1, 1, -1, 1, 0, 4);
camera.lookAt([0, 0, 2], [0, 0, 0], [0, 1, 0]);
camera.setExposureDirect(1);
[view.setCamera(camera), view.setScene(scene), view.setViewport([0, 0, size, size]), view.setPostProcessingEnabled(false)];
renderer.setClearOptions({ clearColor: [0, 0, 0, 0], clear: true });
const loader = engine.createAssetLoader();
const lights = {};
for (const { name, cube, color, metalness, roughness } of scenes) {
    // The loader reads the coefficients out of the metadata; lighting with them is left to the application.
    lights[cube] ??= await (async () => {
        const file = new Uint8Array(await bytes(cube));
        const { shfloats } = engine.createIblFromKtx1(file);
        return Filament.IndirectLight.Builder().reflections(engine.createTextureFromKtx1(file)).irradianceSh(3, shfloats).intensity(1).build(engine);
    })();
    scene.setIndirectLight(lights[cube]);
    const asset = loader.createAsset(sphere(color, metalness, roughness));
    await new Promise((loaded) => asset.loadResources(loaded, null, null, null));
    scene.addEntities(asset.getEntities());
    const pixels = new Float32Array(4 * size * size);
    // Shaders are compiled beside the first frames, which lack what they draw.
    for (let frame = 0; frame < 100 && pixels[2 * size * (size + 1) + 3] === 0; frame++) {
        await new Promise((later) => setTimeout(later, 10));
        renderer.render(swapChain, view);
        engine.execute();
        bind(gl.FRAMEBUFFER, kept);
        gl.readPixels(0, 0, size, size, gl.RGBA, gl.FLOAT, pixels);
    }
    await post(name, pixels);
    scene.removeEntities(asset.getEntities());
    loader.destroyAsset(asset);
}
await done();
