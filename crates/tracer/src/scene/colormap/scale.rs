//! Scales: how values are distributed over the length of a colour map.

/// The scale of a colour map.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum ColorScale {
    /// Equal differences have equal lengths.
    #[default]
    Linear,
    /// Equal ratios have equal lengths; values must be above 0.
    Log,
    /// Linear between `-threshold` and `threshold`, logarithmic beyond, as `SymLogNorm` of matplotlib with base 10 and
    /// `linscale` 1: the linear part is as long as two decades.
    SymLog {
        /// Where the linear part ends; above 0.
        threshold: f64,
    },
}

/// Length of the linear part of [`ColorScale::SymLog`] on each side, in units of `threshold`: it continues the slope
/// of the logarithmic part by one decade, `1 / (1 - 1 / 10)`.
const LINEAR_PART: f64 = 10.0 / 9.0;

impl ColorScale {
    /// The position of a value on the scale. Values without a logarithm are at minus infinity.
    pub fn forward(self, value: f64) -> f64 {
        match self {
            Self::Linear => value,
            Self::Log if value > 0.0 => libm::log10(value),
            Self::Log => f64::NEG_INFINITY,
            Self::SymLog { threshold } if value.abs() <= threshold => value * LINEAR_PART,
            Self::SymLog { threshold } => {
                let decades = libm::log10(value.abs() / threshold);
                (threshold * (LINEAR_PART + decades)).copysign(value)
            }
        }
    }

    /// The value at a position on the scale.
    pub fn inverse(self, position: f64) -> f64 {
        match self {
            Self::Linear => position,
            Self::Log => libm::pow(10.0, position),
            Self::SymLog { threshold } if position.abs() <= threshold * LINEAR_PART => {
                position / LINEAR_PART
            }
            Self::SymLog { threshold } => {
                let decades = position.abs() / threshold - LINEAR_PART;
                (threshold * libm::pow(10.0, decades)).copysign(position)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fractions of the range, from `matplotlib.colors.SymLogNorm(linthresh, vmin=low, vmax=high, base=10)`,
    /// matplotlib 3.10.
    #[test]
    fn symlog_is_that_of_matplotlib() {
        let fraction = |scale: ColorScale, low: f64, high: f64, value: f64| {
            let [low, high, at] = [low, high, value].map(|v| scale.forward(v));
            (at - low) / (high - low)
        };
        let scale = ColorScale::SymLog { threshold: 0.1 };
        for (value, expected) in [
            (-10.0, 0.0),
            (-1.0, 0.160_714_285_714_285_75),
            (-0.05, 0.410_714_285_714_285_7),
            (0.0, 0.5),
            (0.1, 0.678_571_428_571_428_6),
            (0.5, 0.790_905_893_554_003),
            (2.0, 0.887_665_535_017_425_5),
        ] {
            let found = fraction(scale, -10.0, 10.0, value);
            assert!((found - expected).abs() < 1e-12, "{value}: {found}");
        }
        let found = fraction(ColorScale::SymLog { threshold: 0.5 }, -2.0, 100.0, 3.0);
        assert!((found - 0.702_871_028_511_679_4).abs() < 1e-12, "{found}");
    }

    #[test]
    fn positions_lead_back_to_values() {
        for scale in [ColorScale::Linear, ColorScale::Log, ColorScale::SymLog { threshold: 0.01 }] {
            for value in [1e-9, 0.003, 0.01, 0.011, 1.0, 7.5, 1e12] {
                let again = scale.inverse(scale.forward(value));
                assert!((again / value - 1.0).abs() < 1e-12, "{scale:?} {value}");
            }
        }
        let scale = ColorScale::SymLog { threshold: 2.0 };
        assert!((scale.inverse(scale.forward(-300.0)) + 300.0).abs() < 1e-9);
        assert_eq!(ColorScale::Log.forward(-1.0), f64::NEG_INFINITY);
        assert_eq!(ColorScale::Log.forward(0.0), f64::NEG_INFINITY);
    }
}
