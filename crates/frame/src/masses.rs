//! Chemical elements from the masses of atoms, for files that have no symbols.

/// Standard atomic weights by atomic number, from 1 to 92 (IUPAC, 2021, abridged); 0 for elements without one.
const WEIGHTS: [f64; 92] = [
    1.008, 4.0026, 6.94, 9.0122, 10.81, 12.011, 14.007, 15.999, 18.998, 20.180, 22.990, 24.305,
    26.982, 28.085, 30.974, 32.06, 35.45, 39.95, 39.098, 40.078, 44.956, 47.867, 50.942, 51.996,
    54.938, 55.845, 58.933, 58.693, 63.546, 65.38, 69.723, 72.630, 74.922, 78.971, 79.904, 83.798,
    85.468, 87.62, 88.906, 91.224, 92.906, 95.95, 0.0, 101.07, 102.91, 106.42, 107.87, 112.41,
    114.82, 118.71, 121.76, 127.60, 126.90, 131.29, 132.91, 137.33, 138.91, 140.12, 140.91, 144.24,
    0.0, 150.36, 151.96, 157.25, 158.93, 162.50, 164.93, 167.26, 168.93, 173.05, 174.97, 178.49,
    180.95, 183.84, 186.21, 190.23, 192.22, 195.08, 196.97, 200.59, 204.38, 207.2, 208.98, 0.0,
    0.0, 0.0, 0.0, 0.0, 0.0, 232.04, 231.04, 238.03,
];

/// Largest difference between a mass in a file and the weight of its element. Force fields round to one or two digits.
const TOLERANCE: f64 = 0.02;

/// The mass of a methylene group, which coarse models have as one particle. It is near that of nitrogen.
const METHYLENE: f64 = 14.027;

/// The atomic number of the element whose weight is nearest to `mass` and differs by at most 0.02; deuterium is hydrogen.
pub fn element(mass: f64) -> Option<i32> {
    let is_near = |weight: f64| weight > 0.0 && (mass - weight).abs() <= TOLERANCE;
    if is_near(2.014) {
        return Some(1);
    }
    let candidates = (1..).zip(WEIGHTS).filter(|(_, weight)| is_near(*weight));
    let nearest = candidates.min_by(|a, b| (mass - a.1).abs().total_cmp(&(mass - b.1).abs()));
    let is_methylene = |(_, weight): &(i32, f64)| (mass - METHYLENE).abs() < (mass - weight).abs();
    nearest.filter(|found| !is_methylene(found)).map(|(number, _)| number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masses_of_force_fields_are_elements() {
        for (mass, number) in [
            (1.0, 1),
            (1.00797, 1),
            (2.014, 1),
            (12.0, 6),
            (12.01115, 6),
            (14.0, 7),
            (14.01, 7),
            (15.9994, 8),
            (22.98977, 11),
            (26.9815, 13),
            (32.065, 16),
            (35.453, 17),
            (58.6934, 28),
            (63.55, 29),
            (207.2, 82),
            (238.029, 92),
        ] {
            assert_eq!(element(mass), Some(number), "{mass}");
        }
        for mass in [0.0, -1.0, 0.5, 3.024, 14.0266, 14.027, 15.035, 72.0, f64::NAN, f64::INFINITY]
        {
            assert_eq!(element(mass), None, "{mass}");
        }
    }
}
