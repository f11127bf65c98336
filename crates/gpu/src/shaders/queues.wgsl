// Pixels, and queues of rays.
//
// A batch has BATCH samples of each pixel, which pass through the kernels together, depth by depth. `trace_camera` and
// `trace_next` find the intersections of the rays of a depth, add what they show without shadows, and append rays to
// queues: those that go on to that of the next depth, and shadow rays to one for each source of light. `trace_shadow` adds
// the light that arrives; by Whitted's model, `trace_next` does for a source of the depth before, so that the device waits
// for the longest rays of both at once. The order of a queue changes from run to run, but not the picture: in a dispatch,
// each colour of a sample receives at most one contribution. `add_batch` adds the samples to their pixels, one after the
// other, so that the size of a batch does not change the picture, either.

// Sums over the samples of each pixel: red, green, blue, coverage; then, for denoising, those over every second sample;
// then, from `view.first_film` on, each sample of the batch; then, if samples have a second colour, the indirect light of the
// rays that are being traced (HAS_CLAMP), or the light of shadow rays (HAS_LIT). A picture with one sample has its sums
// there, too.
@group(0) @binding(6) var<storage, read_write> film: array<vec4<f32>>;
// The nearest sample of each pixel: depth, index of the sphere, normal, position; then, from `view.first_data` on, the
// samples of the batch
@group(0) @binding(7) var<storage, read_write> data: array<vec4<u32>>;
// Lengths of the queues of a sample: for each depth, that of the rays that go on, then those of shadow rays by source. At
// the end, the lower and the upper word of the light that a clamp takes away
@group(0) @binding(8) var<storage, read_write> queued: array<atomic<u32>>;
// Rays of this depth and of the next one, `RAY` vectors each: origin, pixel with sample, and what the model needs
@group(0) @binding(9) var<storage, read> rays: array<vec4<f32>>;
@group(0) @binding(10) var<storage, read_write> next_rays: array<vec4<f32>>;
// Queues of shadow rays, one behind the other, `SHADOW` vectors each: start, pixel with sample, and what the model needs;
// those that are written, and those that are traced
@group(0) @binding(11) var<storage, read_write> next_shadows: array<vec4<f32>>;
@group(0) @binding(29) var<storage, read> shadows: array<vec4<f32>>;
@group(0) @binding(13) var<uniform> stage: Stage;
// The same over all samples, in two words each
@group(0) @binding(14) var<storage, read_write> sums: array<u32>;

@group(0) @binding(18) var<uniform> current: Current;
// The first surface of each sample, pixel by pixel
@group(0) @binding(20) var<storage, read_write> objects: array<u32>;

// Invocations of a workgroup that follows a queue
const GROUP: u32 = 64u;

// What differs between the dispatches of a sample. `depth` counts from 1; with glass, paths may be at other depths. `last`
// is the queue of the last depth if rays go on behind it, or 0.
struct Stage { depth: u32, source: u32, counters: u32, last: u32 }

// What differs between batches: the number of the first sample
struct Current { sample: u32, zero: u32, zero_too: u32, zero_three: u32 }

// The index in `data` of a pixel whose nearest sample is of the ground
const GROUND: u32 = 0xfffffffeu;

// The number of the queue of the rays that go on from a depth; those of its shadow rays follow, source by source.
fn queue_of(depth: u32) -> u32 {
  return (depth - 1u) * view.queues;
}

// The place of the first shadow ray to a source
fn first_shadow(source: u32) -> u32 {
  return source * (BATCH * view.width * view.height);
}

// The number in the batch of the sample that is being traced
var<private> in_batch: u32 = 0u;

// The bits of a word for the pixel; the number in the batch is above them.
const PIXEL_BITS: u32 = 28u;

fn sample_number() -> u32 { return current.sample + in_batch; }

// A pixel and its sample that is being traced, for queues
fn word_of(pixel: u32) -> f32 { return bitcast<f32>(pixel | (in_batch << PIXEL_BITS)); }

// The pixel of a ray in a queue, whose sample is traced from now on
fn pixel_in(word: f32) -> u32 {
  if (BATCH == 1u) { return bitcast<u32>(word); }
  in_batch = bitcast<u32>(word) >> PIXEL_BITS;
  return bitcast<u32>(word) & ((1u << PIXEL_BITS) - 1u);
}

// The pixel of an invocation for camera rays, whose sample is traced from now on: the samples of a pixel are neighbours.
fn camera_pixel(group: vec3<u32>, local: u32) -> vec2<u32> {
  in_batch = local % BATCH;
  let number = local / BATCH;
  return group.xy * vec2<u32>(TILE_WIDTH, TILE_HEIGHT) + vec2<u32>(number % TILE_WIDTH, number / TILE_WIDTH);
}

// The place of the sample that is being traced, among those of the batch from `first` on
fn place_in(first: u32, pixel: u32) -> u32 { return first + in_batch * view.width * view.height + pixel; }

// Adds light and coverage to the sample of a pixel.
fn add_to_film(pixel: u32, sum: vec4<f32>) { film[place_in(view.first_film, pixel)] += sum; }

// The place in the film of the second colour of the sample that is being traced
fn second_place(pixel: u32) -> u32 { return place_in(view.first_film, pixel) + BATCH * view.width * view.height; }

// The colour of a sample of the batch
fn color_of(number: u32, pixel: u32) -> vec4<f32> {
  let count = view.width * view.height;
  let place = view.first_film + number * count + pixel;
  var color = film[place];
  // Only covered samples have shadow rays
  if (HAS_LIT && color.w > 0.0) { color += vec4<f32>(film[place + BATCH * count].xyz, 0.0); }
  return color;
}

// Keeps the first surface of a sample (HAS_OBJECTS): the index of a sphere, `object_of_ground`, or MISS.
fn keep_object(pixel: u32, object: u32) {
  if (HAS_OBJECTS && stage.depth == 1u) { objects[pixel * view.samples + sample_number()] = object; }
}

// The ground with its coverage, as a negative number
fn object_of_ground(coverage: f32) -> u32 { return bitcast<u32>(-coverage); }

// A sample without a surface
fn no_surface() -> vec4<u32> { return vec4<u32>(bitcast<u32>(FAR), MISS, 0u, 0u); }

// Empties a sample before its camera ray, and what its pixel adds up before the first one.
fn empty_sample(pixel: u32) {
  if (current.sample == 0u) { clear_layers(pixel); }
  film[place_in(view.first_film, pixel)] = vec4<f32>(0.0);
  data[2u * place_in(view.first_data, pixel)] = no_surface();
}

// Keeps the first surface of a sample.
fn keep_surface(depth: f32, index: u32, normal: vec3<f32>, point: vec3<f32>, pixel: u32) {
  let place = 2u * place_in(view.first_data, pixel);
  data[place] = vec4<u32>(bitcast<u32>(depth), index, bitcast<vec2<u32>>(normal.xy));
  data[place + 1u] = vec4<u32>(bitcast<u32>(normal.z), bitcast<vec3<u32>>(point));
}

// Kernels that follow a queue have half as many invocations as it has rays at most, so that fewer end without a ray; some
// have two rays, one after the other.

// The rays that go on from a depth
fn count_next(depth: u32) -> u32 { return atomicLoad(&queued[queue_of(depth)]); }

// The shadow rays of the source from a depth
fn count_shadows(depth: u32) -> u32 { return atomicLoad(&queued[queue_of(depth) + 1u + stage.source]); }

// A number of rays, rounded up to whole workgroups
fn padded(count: u32) -> u32 { return (count + GROUP - 1u) / GROUP * GROUP; }

// The number of all invocations
fn size_of(groups: vec3<u32>) -> u32 { return groups.x * groups.y * GROUP; }

// The shadow rays of a source from a depth.
@compute @workgroup_size(GROUP)
fn trace_shadow(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let count = count_shadows(stage.depth);
  for (var i = linear_index(group, groups, local, GROUP); i < count; i += size_of(groups)) { follow_shadow(i); }
}

// Adds the samples of a batch to their pixels, and keeps the nearest surface of each, the first of equals.
@compute @workgroup_size(GROUP)
fn add_batch(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let pixel = linear_index(group, groups, local, GROUP);
  let count = view.width * view.height;
  if (pixel >= count) { return; }
  if (IS_SINGLE) {
    let color = color_of(0u, pixel);
    if (color.w > 0.0) { film[pixel] = color; }
    return;
  }
  // What the batches before have
  var sum = vec4<f32>(0.0);
  var odd = vec4<f32>(0.0);
  var nearest = no_surface();
  if (current.sample > 0u) {
    sum = film[pixel];
    if (view.has_odd == 1u) { odd = film[count + pixel]; }
    nearest = data[2u * pixel];
  }
  var at = MISS;
  for (var number = 0u; number < min(BATCH, view.samples - current.sample); number++) {
    let value = color_of(number, pixel);
    sum += value;
    if (((current.sample + number) & 1u) == 1u) { odd += value; }
    let place = 2u * (view.first_data + number * count + pixel);
    let found = data[place];
    if (bitcast<f32>(found.x) < bitcast<f32>(nearest.x)) {
      nearest = found;
      at = place;
    }
  }
  film[pixel] = sum;
  if (view.has_odd == 1u) { film[count + pixel] = odd; }
  if (at == MISS && current.sample > 0u) { return; }
  data[2u * pixel] = nearest;
  data[2u * pixel + 1u] = vec4<u32>(0u);
  if (at != MISS) { data[2u * pixel + 1u] = data[at + 1u]; }
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
