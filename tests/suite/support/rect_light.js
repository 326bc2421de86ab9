// One small metal plate per scene, seen along a slanted axis, lit by a rectangle; what the middle of the picture shows.
import * as THREE from 'three';
import { RectAreaLightTexturesLib } from 'three/addons/lights/RectAreaLightTexturesLib.js';

const table = async (name) => {
  const halves = new Uint16Array(await bytes(name));
  const texture = new THREE.DataTexture(halves, 64, 64, THREE.RGBAFormat, THREE.HalfFloatType, THREE.UVMapping,
    THREE.ClampToEdgeWrapping, THREE.ClampToEdgeWrapping, THREE.LinearFilter, THREE.LinearFilter, 1);
  texture.needsUpdate = true;
  return texture;
};
const scenes = JSON.parse(new TextDecoder().decode(await bytes('scenes.json')));
const own = [await table('ltc-matrix'), await table('ltc-amplitude')];
RectAreaLightTexturesLib.init();
const theirs = [RectAreaLightTexturesLib.LTC_HALF_1, RectAreaLightTexturesLib.LTC_HALF_2];
const size = 3;
for (const [name, pair] of [['own', own], ['theirs', theirs]]) {
  [THREE.UniformsLib.LTC_FLOAT_1, THREE.UniformsLib.LTC_FLOAT_2] = pair;
  [THREE.UniformsLib.LTC_HALF_1, THREE.UniformsLib.LTC_HALF_2] = pair;
  const renderer = new THREE.WebGLRenderer();
  renderer.toneMapping = THREE.NoToneMapping;
  const target = new THREE.WebGLRenderTarget(size, size, { type: THREE.FloatType });
  const found = new Float32Array(scenes.length);
  for (const [i, s] of scenes.entries()) {
    const scene = new THREE.Scene();
    const material = new THREE.MeshStandardMaterial({ color: 0xffffff, metalness: 1, roughness: s.roughness });
    scene.add(new THREE.Mesh(new THREE.PlaneGeometry(0.01, 0.01), material));
    const light = new THREE.RectAreaLight(0xffffff, 1, s.width, s.height);
    light.position.set(...s.light);
    light.lookAt(0, 0, 0);
    scene.add(light);
    const camera = new THREE.OrthographicCamera(-1e-3, 1e-3, 1e-3, -1e-3, 0.1, 10);
    const sine = Math.sqrt(1 - s.mu * s.mu);
    camera.position.set(sine, 0, s.mu);
    camera.up.set(0, 1, 0);
    camera.lookAt(0, 0, 0);
    renderer.setRenderTarget(target);
    renderer.render(scene, camera);
    const pixels = new Float32Array(size * size * 4);
    renderer.readRenderTargetPixels(target, 0, 0, size, size, pixels);
    found[i] = pixels[4 * 4];
  }
  await post(name, found);
  renderer.dispose();
}
await done();
