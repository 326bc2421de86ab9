//! Small valid pictures and textures, made in code, and a generator of random numbers.

use kiln::format::{Image, Texture};
use kiln::pack::TexelFormat;

/// SplitMix64: small, and the same everywhere.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 * 2_f64.powi(-53)
    }
}

/// A picture of random values between 2⁻²⁰ and 2¹⁵, with metadata.
pub fn picture(width: usize, height: usize, channels: &[&str]) -> Image<f64> {
    let mut random = Random(7);
    let texels = (0..width * height * channels.len()).map(|_| 2_f64.powf(35.0 * random.unit() - 20.0)).collect();
    let mut image =
        Image::new(width, height, channels, texels).expect("a sample image has as many texels as its size says");
    image.metadata = vec![
        ("kiln.recipe".into(), r#"{"name":"ggx","µ":"sqrt"}"#.into()),
        ("comments".into(), "two\nlines".into()),
        ("kiln.a key that is much longer than thirty-one bytes".into(), String::new()),
    ];
    image
}

/// A cube map of random texels with all its mips, and metadata.
pub fn cube(format: TexelFormat, size: usize) -> Texture {
    let mut random = Random(9);
    let mut texture = Texture::empty_cube(format, size);
    for size in (0..=size.ilog2()).map(|level| size >> level) {
        // Within what the format holds, which may be 1.
        let most = format.largest(0).min(100.0);
        let values: Vec<f64> = (0..6 * size * size * format.channels()).map(|_| most * random.unit()).collect();
        texture.push_level(&values).expect("a level of its size");
    }
    texture.metadata = vec![("kiln.recipe".into(), "{}".into()), ("author".into(), "β".into())];
    texture
}

/// A Radiance picture: 16 × 4, run lengths in every second row, the others flat.
pub fn hdr() -> Vec<u8> {
    let mut random = Random(3);
    let mut file = b"#?RADIANCE\n# made in code\nFORMAT=32-bit_rle_rgbe\nSOFTWARE=kiln tests\n\n-Y 4 +X 16\n".to_vec();
    for y in 0..4 {
        if y % 2 == 0 {
            file.extend([2, 2, 0, 16]);
            for _ in 0..4 {
                file.extend([128 + 10, 100 + random.below(100) as u8, 6]);
                file.extend((0..6).map(|_| 100 + random.below(100) as u8));
            }
        } else {
            (0..16).for_each(|_| file.extend([200, random.below(256) as u8, random.below(256) as u8, 128]));
        }
    }
    file
}
