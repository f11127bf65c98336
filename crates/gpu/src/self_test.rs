//! The arithmetic of a device, found by a comparison of bits with that of the CPU.
//!
//! Pictures equal those of the CPU only if products, sums, quotients and roots are rounded in the same way. Drivers
//! differ in that, so a kernel evaluates the operations of `arithmetic.wgsl` on a table, first as for devices with a
//! fused multiply-add, then as for devices without.

use bytemuck::{Pod, Zeroable};

use crate::arithmetic::Arithmetic;
use crate::arrays::{Array, Uniforms};
use crate::commands::{Commands, Kernel};
use crate::{Device, GpuError};

/// Rows of the table.
const ROWS: usize = 4096;

/// The results of a row of operands.
type Row = [f32; 8];

/// The columns of a row of results.
const NAMES: [&str; 7] = [
    "multiply and add",
    "product",
    "reciprocal",
    "quotient",
    "square root",
    "dot product",
    "fused dot product",
];

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Table {
    zero: f32,
    count: u32,
    pad: [u32; 2],
}

/// The arithmetic of `device`.
///
/// # Errors
/// If it is none of those that are known, or if the device fails.
pub(crate) fn arithmetic_of(device: &Device) -> Result<Arithmetic, GpuError> {
    let operands = operands();
    let mut fault = "";
    for arithmetic in [Arithmetic::Fused, Arithmetic::Separate] {
        let results = evaluate(device, arithmetic, &operands)?;
        let others = operands.iter().cycle().skip(1);
        let expected = operands.iter().zip(others).map(|(a, b)| expected(arithmetic, *a, *b));
        match results.iter().zip(expected).find_map(|(found, expected)| differing(found, &expected))
        {
            None => return Ok(arithmetic),
            Some(name) => fault = name,
        }
    }
    Err(GpuError::SelfTest { adapter: device.adapter().name.clone(), what: fault })
}

/// Numbers of all sizes that occur in pictures, from a fixed sequence: three of either sign, and a positive one.
fn operands() -> Vec<[f32; 4]> {
    let mut state = 0x2545_f491_u32;
    let mut number = || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        // Exponents from 2^-24 to 2^23
        let exponent = 127 - 24 + (state >> 8) % 48;
        f32::from_bits(state & 0x8000_0000 | exponent << 23 | state.rotate_left(9) & 0x007f_ffff)
    };
    (0..ROWS).map(|_| [number(), number(), number(), number().abs()]).collect()
}

fn expected(arithmetic: Arithmetic, [x, y, z, w]: [f32; 4], [a, b, c, _]: [f32; 4]) -> Row {
    let inner = arithmetic.multiply_add(y, b, x * a);
    [
        arithmetic.multiply_add(x, y, z),
        x * y + z,
        1.0 / w,
        x / w,
        w.sqrt(),
        (x * a + y * b) + z * c,
        arithmetic.multiply_add(z, c, inner),
        0.0,
    ]
}

/// The name of the first column with other bits.
fn differing(found: &Row, expected: &Row) -> Option<&'static str> {
    let bits = found.iter().zip(expected).zip(NAMES);
    bits.into_iter().find(|((a, b), _)| a.to_bits() != b.to_bits()).map(|(_, name)| name)
}

fn evaluate(
    device: &Device,
    arithmetic: Arithmetic,
    operands: &[[f32; 4]],
) -> Result<Vec<Row>, GpuError> {
    let source = [
        arithmetic.source(),
        include_str!("shaders/arithmetic.wgsl"),
        include_str!("shaders/self_test.wgsl"),
    ];
    let kernel = Kernel::new(device, &device.module(&source.concat()), "evaluate", &[0, 1, 2]);
    let [mut input, mut output] = [Array::default(), Array::default()];
    input.write(device, "operands", bytemuck::cast_slice(operands))?;
    output.reserve(device, "results", (operands.len() * size_of::<Row>()) as u64)?;
    let mut uniforms = Uniforms::default();
    #[expect(clippy::cast_possible_truncation, reason = "a constant")]
    let table = uniforms.push(&Table { zero: 0.0, count: operands.len() as u32, pad: [0; 2] });
    uniforms.upload(device)?;
    let mut commands = Commands::new(device);
    commands.add(
        &kernel,
        &|binding| match binding {
            0 => uniforms.binding(table),
            1 => input.binding(),
            _ => output.binding(),
        },
        operands.len() as u64,
        64,
    );
    commands.submit();
    device.wait()?;
    Ok(bytemuck::pod_collect_to_vec(&output.read(device)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_tells_both_kinds_of_arithmetic_apart() {
        let operands = operands();
        let others = || operands.iter().cycle().skip(1);
        let rows = |arithmetic| {
            operands.iter().zip(others()).map(move |(a, b)| expected(arithmetic, *a, *b))
        };
        let pairs = || rows(Arithmetic::Fused).zip(rows(Arithmetic::Separate));
        assert!(pairs().any(|(a, b)| differing(&a, &b) == Some("multiply and add")));
        let fused_dots = pairs().filter(|(a, b)| a[6].to_bits() != b[6].to_bits());
        assert!(fused_dots.count() > ROWS / 10);
        assert!(operands.iter().all(|row| row.iter().all(|v| v.is_normal()) && row[3] > 0.0));
    }
}
