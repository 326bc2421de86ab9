// A sphere lit by an `.env` that Kiln wrote, loaded and rendered by Babylon.js: radiance before tone mapping, as floats. Its table of the BRDF
// is Kiln's too, where one is named: what the engine's own would hide by its own errors.
//
// scenes.json: [{ name, cube, table, size, color, metalness, roughness }].
import { Engine } from '@babylonjs/core/Engines/engine.js';
import { Scene } from '@babylonjs/core/scene.js';
import { Camera } from '@babylonjs/core/Cameras/camera.js';
import { TargetCamera } from '@babylonjs/core/Cameras/targetCamera.js';
import { Vector3 } from '@babylonjs/core/Maths/math.vector.js';
import { Color3 } from '@babylonjs/core/Maths/math.color.js';
import { Texture } from '@babylonjs/core/Materials/Textures/texture.js';
import { CubeTexture } from '@babylonjs/core/Materials/Textures/cubeTexture.js';
import { RenderTargetTexture } from '@babylonjs/core/Materials/Textures/renderTargetTexture.js';
import { PBRMaterial } from '@babylonjs/core/Materials/PBR/pbrMaterial.js';
import { Constants } from '@babylonjs/core/Engines/constants.js';
import { CreateSphere } from '@babylonjs/core/Meshes/Builders/sphereBuilder.js';
import '@babylonjs/core/Materials/Textures/Loaders/envTextureLoader.js';
import '@babylonjs/core/Engines/Extensions/engine.cubeTexture.js';
import '@babylonjs/core/Engines/Extensions/engine.renderTarget.js';
import '@babylonjs/core/Engines/Extensions/engine.renderTargetCube.js';
import '@babylonjs/core/Engines/Extensions/engine.readTexture.js';
import '@babylonjs/core/Helpers/sceneHelpers.js';

const canvas = document.createElement('canvas');
const engine = new Engine(canvas, false, { preserveDrawingBuffer: true });
const scenes = JSON.parse(new TextDecoder().decode(await bytes('scenes.json')));
for (const { name, cube: file, table, size, color, metalness, roughness } of scenes) {
    const scene = new Scene(engine);
    const environment = await new Promise((loaded, failed) => {
        const texture = new CubeTexture('/' + file, scene, {
            prefiltered: true, forcedExtension: '.env', createPolynomials: true,
            onLoad: () => loaded(texture), onError: (message) => failed(new Error('Babylon.js does not load it: ' + message)),
        });
    });
    scene.environmentTexture = environment;
    if (table) {
        scene.environmentBRDFTexture = await new Promise((loaded, failed) => {
            const texture = new Texture('/' + table, scene, {
                noMipmap: true, invertY: false, samplingMode: Texture.BILINEAR_SAMPLINGMODE, mimeType: 'image/png',
                onLoad: () => loaded(texture), onError: (message) => failed(new Error('Babylon.js does not load the table: ' + message)),
            });
            texture.isRGBD = true;
            [texture.wrapU, texture.wrapV] = [Texture.CLAMP_ADDRESSMODE, Texture.CLAMP_ADDRESSMODE];
        });
    }
    // Left-handed: a viewer on the side of −Z who looks along +Z has +X to the right.
    // Far away, as reflections go by where the camera is even where rays are parallel.
    const camera = new TargetCamera('camera', new Vector3(0, 0, -1000), scene);
    [camera.minZ, camera.maxZ] = [990, 1010];
    camera.setTarget(Vector3.Zero());
    camera.mode = Camera.ORTHOGRAPHIC_CAMERA;
    [camera.orthoLeft, camera.orthoRight, camera.orthoBottom, camera.orthoTop] = [-1, 1, -1, 1];
    const material = new PBRMaterial('material', scene);
    [material.metallic, material.roughness, material.albedoColor] = [metalness, roughness, new Color3(color, color, color)];
    const sphere = CreateSphere('sphere', { diameter: 2, segments: 64 }, scene);
    sphere.material = material;
    const target = new RenderTargetTexture('target', size, scene, { type: Constants.TEXTURETYPE_FLOAT, generateMipMaps: false });
    [target.renderList, target.activeCamera] = [[sphere], camera];
    // Left to a later pass that there is not: otherwise what is rendered is clamped and gamma-encoded.
    scene.imageProcessingConfiguration.applyByPostProcess = true;
    await scene.whenReadyAsync();
    await new Promise((ready) => {
        const wait = () => (target.isReadyForRendering() ? ready() : setTimeout(wait, 20));
        wait();
    });
    target.render();
    const pixels = await target.readPixels();
    await post(name, new Float32Array(pixels));
    scene.dispose();
}
await done();
