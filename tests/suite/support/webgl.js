// Evaluates GLSL at points: one row of the framebuffer per case, floats in and floats out.
//
// (webgpu.js follows, in the same module.) cases.json: { cases: [{ name, fragment, compute, points, n, textures: [{ name, kind, format, levels: [{ size, file }] }] }] }
const canvas = document.createElement('canvas');
const gl = canvas.getContext('webgl2');
if (!gl || !gl.getExtension('EXT_color_buffer_float') || !gl.getExtension('OES_texture_float_linear')) {
    throw new Error('no WebGL 2 with float textures and float framebuffers');
}
const FORMATS = {
    r16f: [gl.R16F, gl.RED, gl.HALF_FLOAT],
    rg16f: [gl.RG16F, gl.RG, gl.HALF_FLOAT],
    rgba16f: [gl.RGBA16F, gl.RGBA, gl.HALF_FLOAT],
    r32f: [gl.R32F, gl.RED, gl.FLOAT],
    rg32f: [gl.RG32F, gl.RG, gl.FLOAT],
    rgba32f: [gl.RGBA32F, gl.RGBA, gl.FLOAT],
};
const TARGETS = {
    '2d': gl.TEXTURE_2D, panorama: gl.TEXTURE_2D, '3d': gl.TEXTURE_3D, array: gl.TEXTURE_2D_ARRAY, cube: gl.TEXTURE_CUBE_MAP,
};

function compile(kind, source) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) {
        throw new Error(gl.getShaderInfoLog(shader) + '\n' + source);
    }
    return shader;
}

async function upload(texture) {
    const target = TARGETS[texture.kind];
    const [internal, format, type] = FORMATS[texture.format];
    const view = (buffer) => (type === gl.FLOAT ? new Float32Array(buffer) : new Uint16Array(buffer));
    gl.bindTexture(target, gl.createTexture());
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    for (const [level, { size: [w, h, d], file }] of texture.levels.entries()) {
        const data = view(await bytes(file));
        if (target === gl.TEXTURE_3D || target === gl.TEXTURE_2D_ARRAY) {
            gl.texImage3D(target, level, internal, w, h, d, 0, format, type, data);
        } else if (target === gl.TEXTURE_2D) {
            gl.texImage2D(target, level, internal, w, h, 0, format, type, data);
        } else {
            for (let face = 0; face < 6; face++) {
                const n = data.length / 6;
                const texels = data.subarray(face * n, (face + 1) * n);
                gl.texImage2D(gl.TEXTURE_CUBE_MAP_POSITIVE_X + face, level, internal, w, h, 0, format, type, texels);
            }
        }
    }
    gl.texParameteri(target, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    gl.texParameteri(target, gl.TEXTURE_MIN_FILTER, texture.levels.length > 1 ? gl.LINEAR_MIPMAP_LINEAR : gl.LINEAR);
    gl.texParameteri(target, gl.TEXTURE_MAX_LEVEL, texture.levels.length - 1);
    for (const wrap of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T, gl.TEXTURE_WRAP_R]) {
        gl.texParameteri(target, wrap, gl.CLAMP_TO_EDGE);
    }
    if (texture.kind === 'panorama') gl.texParameteri(target, gl.TEXTURE_WRAP_S, gl.REPEAT);
}

function target(width) {
    const texture = gl.createTexture();
    gl.activeTexture(gl.TEXTURE15);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, width, 1);
    gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    gl.viewport(0, 0, width, 1);
}

const VERTEX = `#version 300 es
void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }`;

const { cases } = JSON.parse(new TextDecoder().decode(await bytes('cases.json')));
for (const one of cases) {
    const program = gl.createProgram();
    gl.attachShader(program, compile(gl.VERTEX_SHADER, VERTEX));
    gl.attachShader(program, compile(gl.FRAGMENT_SHADER, one.fragment));
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    gl.useProgram(program);
    target(one.n);
    const points = { name: 'points', kind: '2d', format: 'rgba32f', levels: [{ size: [one.n, 1, 1], file: one.points }] };
    for (const [unit, texture] of [points, ...one.textures].entries()) {
        gl.activeTexture(gl.TEXTURE0 + unit);
        await upload(texture);
        gl.uniform1i(gl.getUniformLocation(program, texture.name), unit);
    }
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    const found = new Float32Array(4 * one.n);
    gl.readPixels(0, 0, one.n, 1, gl.RGBA, gl.FLOAT, found);
    if (gl.getError()) throw new Error('WebGL error in ' + one.name);
    await post(one.name, found);
}
