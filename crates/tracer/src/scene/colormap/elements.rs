//! Colours of chemical elements by atomic number.

use glam::Vec3;

use super::linear_from_srgb;

/// The colour of the element `number`, linear RGB; that of Jmol for unknown elements if there is no such element.
pub(super) fn element_color(number: i64) -> Vec3 {
    let index = usize::try_from(number.saturating_sub(1)).ok();
    let known = index.and_then(|index| COLORS.get(index));
    let [_, rgb @ ..] = known.unwrap_or(&OTHER_COLOR).to_be_bytes();
    Vec3::from_array(rgb.map(|byte| linear_from_srgb(f32::from(byte) / 255.0)))
}

/// The same for pictures in front of white: colours without a dark channel, which are white and light greys, are no
/// lighter than [`LIGHTEST`].
pub(super) fn color_on_white(number: i64) -> Vec3 {
    let color = element_color(number);
    let lightest = linear_from_srgb(LIGHTEST);
    let is_nearly_white = color.min_element() > linear_from_srgb(NEARLY_WHITE);
    if is_nearly_white { color * (lightest / color.max_element()).min(1.0) } else { color }
}

/// The lightest grey that stands out from white in the light of the default environment, sRGB.
const LIGHTEST: f32 = 0.82;

/// A channel above which a colour may look white, sRGB.
const NEARLY_WHITE: f32 = 0.78;

/// Colour of what is no element, sRGB.
const OTHER_COLOR: u32 = 0xff_14_93;

/// Colours of elements by atomic number from 1, sRGB: those of Jmol (jmol.sourceforge.net/jscolors), which follow the
/// models of Corey, Pauling and Koltun.
const COLORS: [u32; 109] = [
    0xff_ff_ff, 0xd9_ff_ff, 0xcc_80_ff, 0xc2_ff_00, 0xff_b5_b5, 0x90_90_90, 0x30_50_f8, 0xff_0d_0d,
    0x90_e0_50, 0xb3_e3_f5, 0xab_5c_f2, 0x8a_ff_00, 0xbf_a6_a6, 0xf0_c8_a0, 0xff_80_00, 0xff_ff_30,
    0x1f_f0_1f, 0x80_d1_e3, 0x8f_40_d4, 0x3d_ff_00, 0xe6_e6_e6, 0xbf_c2_c7, 0xa6_a6_ab, 0x8a_99_c7,
    0x9c_7a_c7, 0xe0_66_33, 0xf0_90_a0, 0x50_d0_50, 0xc8_80_33, 0x7d_80_b0, 0xc2_8f_8f, 0x66_8f_8f,
    0xbd_80_e3, 0xff_a1_00, 0xa6_29_29, 0x5c_b8_d1, 0x70_2e_b0, 0x00_ff_00, 0x94_ff_ff, 0x94_e0_e0,
    0x73_c2_c9, 0x54_b5_b5, 0x3b_9e_9e, 0x24_8f_8f, 0x0a_7d_8c, 0x00_69_85, 0xc0_c0_c0, 0xff_d9_8f,
    0xa6_75_73, 0x66_80_80, 0x9e_63_b5, 0xd4_7a_00, 0x94_00_94, 0x42_9e_b0, 0x57_17_8f, 0x00_c9_00,
    0x70_d4_ff, 0xff_ff_c7, 0xd9_ff_c7, 0xc7_ff_c7, 0xa3_ff_c7, 0x8f_ff_c7, 0x61_ff_c7, 0x45_ff_c7,
    0x30_ff_c7, 0x1f_ff_c7, 0x00_ff_9c, 0x00_e6_75, 0x00_d4_52, 0x00_bf_38, 0x00_ab_24, 0x4d_c2_ff,
    0x4d_a6_ff, 0x21_94_d6, 0x26_7d_ab, 0x26_66_96, 0x17_54_87, 0xd0_d0_e0, 0xff_d1_23, 0xb8_b8_d0,
    0xa6_54_4d, 0x57_59_61, 0x9e_4f_b5, 0xab_5c_00, 0x75_4f_45, 0x42_82_96, 0x42_00_66, 0x00_7d_00,
    0x70_ab_fa, 0x00_ba_ff, 0x00_a1_ff, 0x00_8f_ff, 0x00_80_ff, 0x00_6b_ff, 0x54_5c_f2, 0x78_5c_e3,
    0x8a_4f_e3, 0xa1_36_d4, 0xb3_1f_d4, 0xb3_1f_ba, 0xb3_0d_a6, 0xbd_0d_87, 0xc7_00_66, 0xcc_00_59,
    0xd1_00_4f, 0xd9_00_45, 0xe0_00_38, 0xe6_00_2e, 0xeb_00_26,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_atoms_are_grey_in_front_of_white() {
        for number in [1, 2, 21, 78] {
            let [own, on_white] = [element_color(number), color_on_white(number)];
            assert!(on_white.max_element() < 0.65 && on_white.cmple(own).all(), "{number}");
        }
        assert_eq!(color_on_white(1).x, color_on_white(1).z);
        for number in [6, 8, 16, 79] {
            assert_eq!(color_on_white(number), element_color(number), "{number}");
        }
    }

    #[test]
    fn elements_have_the_colours_of_jmol() {
        assert_eq!(element_color(1), Vec3::ONE);
        let srgb = |rgb: [u8; 3]| rgb.map(|byte| linear_from_srgb(f32::from(byte) / 255.0));
        for (number, rgb) in [
            (6, [144, 144, 144]),
            (7, [48, 80, 248]),
            (8, [255, 13, 13]),
            (16, [255, 255, 48]),
            (109, [235, 0, 38]),
            (0, [255, 20, 147]),
            (i64::MIN, [255, 20, 147]),
            (4242, [255, 20, 147]),
        ] {
            assert_eq!(element_color(number).to_array(), srgb(rgb), "{number}");
        }
    }
}
