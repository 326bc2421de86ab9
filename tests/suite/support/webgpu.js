// Evaluates WGSL at the same points: a compute shader per case that has any, floats in and floats out. Without the means it says so by no result.
const KINDS = { '2d': '2d', panorama: '2d', '3d': '3d', array: '2d-array', cube: 'cube' };

async function device() {
    const adapter = navigator.gpu && (await navigator.gpu.requestAdapter());
    if (!adapter || !adapter.features.has('float32-filterable')) return null;
    return adapter.requestDevice({ requiredFeatures: ['float32-filterable'] });
}

async function texture(gpu, { kind, format, levels }) {
    const [w, h, d] = levels[0].size;
    const layers = kind === 'cube' ? 6 : d;
    const made = gpu.createTexture({
        size: [w, h, layers], dimension: kind === '3d' ? '3d' : '2d', mipLevelCount: levels.length, format: format.replace(/f$/, 'float'),
        usage: GPUTextureUsage.TEXTURE_BINDING | GPUTextureUsage.COPY_DST,
    });
    for (const [mipLevel, { size: [w, h, d], file }] of levels.entries()) {
        const [data, layers] = [await bytes(file), kind === 'cube' ? 6 : d];
        gpu.queue.writeTexture({ texture: made, mipLevel }, data, { bytesPerRow: data.byteLength / h / layers, rowsPerImage: h }, [w, h, layers]);
    }
    return made.createView({ dimension: KINDS[kind] });
}

const gpu = cases.some((one) => one.compute) && (await device());
for (const one of gpu ? cases.filter((one) => one.compute) : []) {
    gpu.pushErrorScope('validation');
    const module = gpu.createShaderModule({ code: one.compute });
    const errors = (await module.getCompilationInfo()).messages.filter((message) => message.type === 'error');
    if (errors.length) throw new Error(one.name + ': ' + errors.map((e) => e.message + ' in line ' + e.lineNum).join('; ') + '\n' + one.compute);
    const size = 16 * one.n;
    const points = gpu.createBuffer({ size, usage: GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_DST });
    const results = gpu.createBuffer({ size, usage: GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_SRC });
    const read = gpu.createBuffer({ size, usage: GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST });
    gpu.queue.writeBuffer(points, 0, await bytes(one.points));
    const bound = [{ buffer: points }, { buffer: results }];
    for (const of of one.textures) {
        const addressModeU = of.kind === 'panorama' ? 'repeat' : 'clamp-to-edge';
        bound.push(await texture(gpu, of));
        bound.push(gpu.createSampler({ magFilter: 'linear', minFilter: 'linear', mipmapFilter: 'linear', addressModeU }));
    }
    const pipeline = await gpu.createComputePipelineAsync({ layout: 'auto', compute: { module, entryPoint: 'main' } });
    const entries = bound.map((resource, binding) => ({ binding, resource }));
    const commands = gpu.createCommandEncoder();
    const pass = commands.beginComputePass();
    pass.setPipeline(pipeline);
    pass.setBindGroup(0, gpu.createBindGroup({ layout: pipeline.getBindGroupLayout(0), entries }));
    pass.dispatchWorkgroups(one.n);
    pass.end();
    commands.copyBufferToBuffer(results, 0, read, 0, size);
    gpu.queue.submit([commands.finish()]);
    await read.mapAsync(GPUMapMode.READ);
    const error = await gpu.popErrorScope();
    if (error) throw new Error(one.name + ': ' + error.message);
    await post(one.name + '.wgsl', read.getMappedRange().slice(0));
}
await done();
