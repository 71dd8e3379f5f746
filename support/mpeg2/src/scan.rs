//! Scanning orders (7.3): zig-zag and alternate.

/// Raster position (`8 * v + u`) of the coefficients in transmission order, Figure 7-2.
pub const ZIGZAG: [usize; 64] = {
    let mut order = [0; 64];
    let (mut u, mut v) = (0usize, 0usize);
    let mut i = 0;
    while i < 64 {
        order[i] = 8 * v + u;
        // Even diagonals run up to the right, and odd diagonals run down to the left.
        if (u + v) % 2 == 0 {
            if u == 7 {
                v += 1;
            } else if v == 0 {
                u += 1;
            } else {
                u += 1;
                v -= 1;
            }
        } else if v == 7 {
            u += 1;
        } else if u == 0 {
            v += 1;
        } else {
            u -= 1;
            v += 1;
        }
        i += 1;
    }
    order
};

/// Figure 7-3 (alternate_scan = 1), as printed: the index in transmission order of each raster position.
#[rustfmt::skip]
const ALTERNATE_PRINTED: [usize; 64] = [
     0,  4,  6, 20, 22, 36, 38, 52,
     1,  5,  7, 21, 23, 37, 39, 53,
     2,  8, 19, 24, 34, 40, 50, 54,
     3,  9, 18, 25, 35, 41, 51, 55,
    10, 17, 26, 30, 42, 46, 56, 60,
    11, 16, 27, 31, 43, 47, 57, 61,
    12, 15, 28, 32, 44, 48, 58, 62,
    13, 14, 29, 33, 45, 49, 59, 63,
];

/// Raster position of the coefficients in transmission order with alternate_scan = 1.
pub const ALTERNATE: [usize; 64] = {
    let mut order = [0; 64];
    let mut raster = 0;
    while raster < 64 {
        order[ALTERNATE_PRINTED[raster]] = raster;
        raster += 1;
    }
    order
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_is_the_printed_one() {
        // Table of scan[0][v][u], as printed: the index in transmission order of each raster position.
        #[rustfmt::skip]
        let printed = [
            0, 1, 5, 6, 14, 15, 27, 28,
            2, 4, 7, 13, 16, 26, 29, 42,
            3, 8, 12, 17, 25, 30, 41, 43,
            9, 11, 18, 24, 31, 40, 44, 53,
            10, 19, 23, 32, 39, 45, 52, 54,
            20, 22, 33, 38, 46, 51, 55, 60,
            21, 34, 37, 47, 50, 56, 59, 61,
            35, 36, 48, 49, 57, 58, 62, 63,
        ];
        for (raster, &place) in printed.iter().enumerate() {
            assert_eq!(ZIGZAG[place], raster);
        }
    }

    #[test]
    fn the_alternate_order_visits_every_position() {
        let mut seen = ALTERNATE;
        seen.sort_unstable();
        assert_eq!(seen, std::array::from_fn(|raster| raster));
    }
}
