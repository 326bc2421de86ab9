// Spheres lit by atlases that Kiln wrote, loaded and rendered by PlayCanvas: radiance before tone mapping, as floats.
//
// scenes.json: [{ name, cube, table, size, color, metalness, roughness }], cubes being atlases, and tables the sh.json whose coefficients
// light the sphere instead of the atlas' own tile of irradiance.
import * as pc from 'playcanvas';

const scenes = JSON.parse(new TextDecoder().decode(await bytes('scenes.json')));
const canvas = document.createElement('canvas');
const app = new pc.Application(canvas, { graphicsDeviceOptions: { deviceTypes: [pc.DEVICETYPE_WEBGL2] } });
const device = app.graphicsDevice;

// As an application has it: an asset that says what the PNG holds.
const atlases = {};
function atlas(file) {
    atlases[file] ??= new Promise((loaded, failed) => {
        const asset = new pc.Asset(file, 'texture', { url: '/' + file }, {
            type: 'rgbp', mipmaps: false, addressu: 'clamp', addressv: 'clamp',
        });
        asset.once('load', () => loaded(asset.resource));
        asset.once('error', (message) => failed(new Error('PlayCanvas does not load it: ' + message)));
        app.assets.add(asset);
        app.assets.load(asset);
    });
    return atlases[file];
}

const { size } = scenes[0];
const colorBuffer = new pc.Texture(device, { width: size, height: size, format: pc.PIXELFORMAT_RGBA32F, mipmaps: false });
const target = new pc.RenderTarget({ colorBuffer, depth: true });
const camera = new pc.Entity();
// Far away, as reflections go by where the camera is even where rays are parallel.
camera.addComponent('camera', {
    projection: pc.PROJECTION_ORTHOGRAPHIC, orthoHeight: 1, nearClip: 990, farClip: 1010, renderTarget: target,
    clearColor: new pc.Color(0, 0, 0, 0), toneMapping: pc.TONEMAP_NONE, gammaCorrection: pc.GAMMA_NONE,
    // Nothing but the sphere: no sky.
    layers: [pc.LAYERID_WORLD],
});
camera.setPosition(0, 0, 1000);
app.root.addChild(camera);
const mesh = pc.Mesh.fromGeometry(device, new pc.SphereGeometry({ radius: 1, latitudeBands: 96, longitudeBands: 192 }));
const instance = new pc.MeshInstance(mesh, new pc.StandardMaterial());
const sphere = new pc.Entity();
sphere.addComponent('render', { meshInstances: [instance] });
app.root.addChild(sphere);

for (const { name, cube, table, color, metalness, roughness } of scenes) {
    app.scene.envAtlas = await atlas(cube);
    const material = new pc.StandardMaterial();
    // Colours are given as displays have them.
    material.diffuse = new pc.Color(color, color, color).gamma();
    [material.useMetalness, material.metalness, material.gloss] = [true, metalness, 1 - roughness];
    if (table) {
        const { engine } = JSON.parse(new TextDecoder().decode(await bytes(table)));
        material.ambientSH = new Float32Array(engine.coefficients.flat());
    }
    material.update();
    instance.material = material;
    app.render();
    const pixels = await colorBuffer.read(0, 0, size, size, { renderTarget: target, immediate: true });
    await post(name, pixels);
}
await done();
