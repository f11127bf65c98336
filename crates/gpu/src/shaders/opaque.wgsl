// Paths between opaque surfaces: each pixel has one ray at each depth, which has the number of reflections before it.

struct State { zero: u32 }

fn camera_state(pixel: u32) -> State { return State(0u); }

fn bounces_of(state: State) -> u32 { return stage.depth - 1u; }

fn depth_along(state: State) -> u32 { return stage.depth; }

fn first_of(state: State) -> u32 { return select(BOUNCE_FIRST, NOTHING_FIRST, stage.depth == 1u); }

fn seed_of(pixel: u32, state: State) -> Wide { return seed_at(pixel, stage.depth - 1u, BOUNCED); }

fn bounced(state: State, start: vec3<f32>) -> State { return state; }

fn stored_state(i: u32) -> State { return State(0u); }

fn store_state(place: u32, pixel: u32, state: State) { }

fn count_refracted(next: Next) { }

fn absorbed(path: Path, ray: Ray, hit: Hit, surface: Surface) -> vec3<f32> { return path.throughput; }

fn go_on(
  is_hit: bool, path: Path, throughput: vec3<f32>, ray: Ray, surface: Surface, next: ptr<function, Next>,
  sum: ptr<function, vec4<f32>>,
) { }
