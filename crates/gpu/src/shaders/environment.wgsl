// Light from infinitely far away: a table of equal-area octahedral texels that is sampled, and the image that mirrors
// show. Both are computed by the host.

// Records of tables (radiance, density) and pixels of the image
@group(0) @binding(16) var<storage, read> texels: array<vec4<f32>>;
// Cumulative probabilities of tables, and tables of materials
@group(0) @binding(17) var<storage, read> constants: array<f32>;

// The image at its own resolution (HAS_DETAIL): half floats, three a pixel, two in a word. Its middle column is in front
@group(0) @binding(19) var<storage, read> detail: array<u32>;

// Size of the image without detail
const COLUMNS: u32 = 512u;
const ROWS: u32 = 256u;
// Rays with a density above this part of the texels per steradian see the image
const SHARP: f32 = 0.0625;

// The interval among those that end at `constants[first..first + side]` that contains `u`, and the position in it.
struct Interval { index: u32, position: f32 }

fn invert(first: u32, side: u32, u: f32) -> Interval {
  var index = 0u;
  var low = 0.0;
  var high = 1.0;
  for (var step = side / 2u; step > 0u; step /= 2u) {
    let end = constants[first + index + step - 1u];
    if (end <= u) {
      index += step;
      low = end;
    } else {
      high = end;
    }
  }
  let position = (u - low) / (high - low);
  return Interval(index, clamp(position, 0.0, 0.99999994));
}

fn square_to_sphere(at: vec2<f32>) -> vec3<f32> {
  let ax = abs(at.x);
  let ay = abs(at.y);
  let above = 1.0 - (ax + ay);
  let r = 1.0 - abs(above);
  let angle = (ay - ax) / select(1.0, r, r > 0.0) * QUARTER_PI;
  let turned = sine_cosine(angle);
  let r2 = r * r;
  let level = r * sqrt(max(1.0 - 0.5 * r2, 0.0));
  return vec3<f32>(
    with_sign(level * (turned.y - turned.x), at.x),
    with_sign(level * (turned.y + turned.x), at.y),
    with_sign(1.0 - r2, above),
  );
}

fn sphere_to_square(d: vec3<f32>) -> vec2<f32> {
  let r = sqrt(max(1.0 - abs(d.z), 0.0));
  let ay = angle_of(abs(d.y), abs(d.x)) * (2.0 * INVERSE_PI) * r;
  let ax = r - ay;
  let folded = select(vec2<f32>(ax, ay), vec2<f32>(1.0 - ay, 1.0 - ax), d.z < 0.0);
  return vec2<f32>(with_sign(folded.x, d.x), with_sign(folded.y, d.y));
}

fn from_axes(own: vec3<f32>) -> vec3<f32> {
  return own.x * scene.axis_right + own.y * scene.axis_back + own.z * scene.axis_up;
}

fn to_axes(d: vec3<f32>) -> vec3<f32> {
  return vec3<f32>(dot(d, scene.axis_right), dot(d, scene.axis_back), dot(d, scene.axis_up));
}

// A direction from which light arrives, its radiance, and the density of the choice.
struct Arriving { direction: vec3<f32>, radiance: vec3<f32>, pdf: f32 }

fn sample_table(table: Table, u: vec2<f32>) -> Arriving {
  let row = invert(table.ends, table.side, u.y);
  let cell = invert(table.ends + table.side * (1u + row.index), table.side, u.x);
  let record = texels[table.records + row.index * table.side + cell.index];
  let at = vec2<f32>(f32(cell.index) + cell.position, f32(row.index) + row.position);
  return Arriving(from_axes(square_to_sphere(at * (2.0 / f32(table.side)) - 1.0)), record.xyz, record.w);
}

// Radiance and density of the texel of a direction in the axes of the environment
fn texel_at(table: Table, own: vec3<f32>) -> vec4<f32> {
  let at = (sphere_to_square(own) + 1.0) * (0.5 * f32(table.side));
  let cell = min(vec2<u32>(max(at, vec2<f32>(0.0))), vec2<u32>(table.side - 1u));
  return texels[table.records + cell.y * table.side + cell.x];
}

fn detail_number(i: u32) -> f32 { return unpack2x16float(detail[i >> 1u])[i & 1u]; }

fn image_pixel(row: u32, column: u32) -> vec3<f32> {
  if (HAS_DETAIL) {
    let at = 3u * (row * scene.detail_size.x + column);
    return vec3<f32>(detail_number(at), detail_number(at + 1u), detail_number(at + 2u));
  }
  return texels[scene.image + row * COLUMNS + column].xyz;
}

// The radiance in the image, bilinear between the centres of pixels
fn image_at(own: vec3<f32>) -> vec3<f32> {
  let size = select(vec2<u32>(COLUMNS, ROWS), scene.detail_size, HAS_DETAIL);
  var turns = angle_of(own.y, own.x) * (0.5 * INVERSE_PI);
  if (HAS_DETAIL) { turns -= 0.25; }
  let x = select(turns, turns + 1.0, turns < 0.0) * f32(size.x) + 0.5;
  let y = arc_cosine(clamp(own.z, -1.0, 1.0)) * (INVERSE_PI * f32(size.y)) + 0.5;
  let column = min(u32(x), size.x);
  let row = min(u32(y), size.y);
  let across = x - f32(column);
  let down = y - f32(row);
  let left = (column + size.x - 1u) % size.x;
  let right = column % size.x;
  let upper = max(row, 1u) - 1u;
  let lower = min(row, size.y - 1u);
  let above = image_pixel(upper, left) * (1.0 - across) + image_pixel(upper, right) * across;
  let below = image_pixel(lower, left) * (1.0 - across) + image_pixel(lower, right) * across;
  let seen = above * (1.0 - down) + below * down;
  if (HAS_DETAIL) { return scene.detail_scale * seen; }
  return seen;
}

// The weight of a direction sampled with a density that could have been sampled with another one.
fn balance(sampled: f32, other: f32) -> f32 {
  if (sampled < FAR) { return sampled / (sampled + other); }
  return 1.0;
}

// What a ray in a direction, which was sampled with density `pdf`, brings of the environment; black without one.
fn environment_along(direction: vec3<f32>, pdf: f32) -> vec3<f32> {
  if (scene.environment.side == 0u) { return vec3<f32>(0.0); }
  let own = to_axes(direction);
  let texel = texel_at(scene.environment, own);
  let per_steradian = f32(scene.environment.side * scene.environment.side) / (4.0 * PI);
  if (pdf > SHARP * per_steradian) { return balance(pdf, texel.w) * image_at(own); }
  return balance(pdf, texel.w) * texel.xyz;
}

// The irradiance on a surface, from spherical harmonics
fn irradiance_at(normal: vec3<f32>) -> vec3<f32> {
  let own = to_axes(normal);
  var sum = 0.2820948 * scene.harmonics[0].xyz;
  sum += 0.4886025 * (own.y * scene.harmonics[1].xyz + own.z * scene.harmonics[2].xyz + own.x * scene.harmonics[3].xyz);
  sum += 1.0925484 * (own.x * own.y * scene.harmonics[4].xyz + own.y * own.z * scene.harmonics[5].xyz);
  sum += 0.31539157 * (3.0 * own.z * own.z - 1.0) * scene.harmonics[6].xyz;
  sum += 1.0925484 * own.x * own.z * scene.harmonics[7].xyz;
  sum += 0.5462742 * (own.x * own.x - own.y * own.y) * scene.harmonics[8].xyz;
  return max(sum, vec3<f32>(0.0));
}
