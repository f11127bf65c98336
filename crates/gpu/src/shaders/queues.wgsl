// Pixels, and queues of rays.
//
// Each sample of all pixels passes through the kernels depth by depth. `trace_camera` and `trace_next` find the
// intersections of the rays of a depth, add what they show without shadows, and append rays to queues: those that go on
// to that of the next depth, and shadow rays to one for each source of light. `trace_shadow` adds the light that arrives.
// The order of a queue changes from run to run, but not the picture: in a dispatch, each pixel receives at most one
// contribution.

// Sums over the samples of each pixel: red, green, blue, coverage; then, for denoising, those over every second sample;
// then, with a clamp, the indirect light of the ray that is being traced
@group(0) @binding(6) var<storage, read_write> film: array<vec4<f32>>;
// The nearest sample of each pixel: depth, index of the sphere, normal, position
@group(0) @binding(7) var<storage, read_write> data: array<vec4<u32>>;
// Lengths of the queues of a sample: for each depth, that of the rays that go on, then those of shadow rays by source. At
// the end, the lower and the upper word of the light that a clamp takes away
@group(0) @binding(8) var<storage, read_write> queued: array<atomic<u32>>;
// Rays of this depth and of the next one, `RAY` vectors each: origin and pixel, and what the model needs
@group(0) @binding(9) var<storage, read> rays: array<vec4<f32>>;
@group(0) @binding(10) var<storage, read_write> next_rays: array<vec4<f32>>;
// Queues of shadow rays, one behind the other, `SHADOW` vectors each: start and pixel, and what the model needs
@group(0) @binding(11) var<storage, read_write> shadows: array<vec4<f32>>;
@group(0) @binding(13) var<uniform> stage: Stage;
// The same over all samples, in two words each
@group(0) @binding(14) var<storage, read_write> sums: array<u32>;

@group(0) @binding(18) var<uniform> current: Current;
// The first surface of each sample, pixel by pixel
@group(0) @binding(20) var<storage, read_write> objects: array<u32>;

// Invocations of a workgroup that follows a queue
const GROUP: u32 = 64u;

// What differs between the dispatches of a sample. `depth` counts from 1; with glass, paths may be at other depths. `last` is the queue of the last depth if rays go
// on behind it, or 0.
struct Stage { depth: u32, source: u32, counters: u32, last: u32 }

// What differs between samples
struct Current { sample: u32, zero: u32, zero_too: u32, zero_three: u32 }

// The index in `data` of a pixel whose nearest sample is of the ground
const GROUND: u32 = 0xfffffffeu;

// The number of the queue of the rays that go on from a depth; those of its shadow rays follow, source by source.
fn queue_of(depth: u32) -> u32 {
  return (depth - 1u) * view.queues;
}

// The place of the first shadow ray to a source
fn first_shadow(source: u32) -> u32 {
  return source * view.width * view.height;
}

// Adds light and coverage to a pixel.
fn add_to_film(pixel: u32, sum: vec4<f32>) {
  film[pixel] += sum;
  if (view.has_odd == 1u && (current.sample & 1u) == 1u) { film[view.width * view.height + pixel] += sum; }
}

// Keeps the first surface of a sample (HAS_OBJECTS): the index of a sphere, `object_of_ground`, or MISS.
fn keep_object(pixel: u32, object: u32) {
  if (HAS_OBJECTS && stage.depth == 1u) { objects[pixel * view.samples + current.sample] = object; }
}

// The ground with its coverage, as a negative number
fn object_of_ground(coverage: f32) -> u32 { return bitcast<u32>(-coverage); }

// Empties a pixel before its first sample.
fn clear_pixel(pixel: u32) {
  clear_layers(pixel);
  film[pixel] = vec4<f32>(0.0);
  if (view.has_odd == 1u) { film[view.width * view.height + pixel] = vec4<f32>(0.0); }
  data[2u * pixel] = vec4<u32>(bitcast<u32>(FAR), MISS, 0u, 0u);
  data[2u * pixel + 1u] = vec4<u32>(0u);
}

// Keeps the data of the nearest sample of a pixel, the first of equals.
fn keep_nearest(depth: f32, index: u32, normal: vec3<f32>, point: vec3<f32>, pixel: u32) {
  if (depth < bitcast<f32>(data[2u * pixel].x)) {
    data[2u * pixel] = vec4<u32>(bitcast<u32>(depth), index, bitcast<vec2<u32>>(normal.xy));
    data[2u * pixel + 1u] = vec4<u32>(bitcast<u32>(normal.z), bitcast<vec3<u32>>(point));
  }
}

// Empties all queues, and adds up their lengths. The rays behind the last depth are those of the first queue then, and
// counted with it.
@compute @workgroup_size(GROUP)
fn empty_queues(@builtin(global_invocation_id) id: vec3<u32>) {
  let counter = id.x;
  if (counter >= stage.counters || (counter > 0u && counter == stage.last)) { return; }
  var rest = 0u;
  if (counter == 0u && stage.last > 0u) { rest = atomicExchange(&queued[stage.last], 0u); }
  let count = atomicExchange(&queued[counter], rest);
  let sum = sums[2u * counter] + count;
  sums[2u * counter + 1u] += select(0u, 1u, sum < count);
  sums[2u * counter] = sum;
}
