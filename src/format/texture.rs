//! The neutral texture: packed texels of two- and three-dimensional textures, arrays and cube maps, before any container.

use crate::colour::Primaries;
use crate::error::{Error, Result};
use crate::pack::{PackReport, TexelFormat};

/// Texels as they are stored, and what is known of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    /// How a texel is stored.
    pub format: TexelFormat,
    /// Texels in a row of level 0.
    pub width: usize,
    /// Rows of level 0.
    pub height: usize,
    /// Slices of level 0 of a three-dimensional texture; 0 for any other.
    pub depth: usize,
    /// Layers of an array; 0 for what is no array.
    pub array_layers: usize,
    /// 1, or 6 for a cube map: +X −X +Y −Y +Z −Z.
    pub faces: usize,
    /// The packed texels, level 0 first; a level is its array layers, each its faces or slices, each its rows, a row its texels.
    pub levels: Vec<Vec<u8>>,
    /// Names of the channels, for containers that have such; R, G, B and A where there are none.
    pub channels: Vec<String>,
    /// Key/value pairs.
    pub metadata: Vec<(String, String)>,
    /// What red, green and blue are; Rec. 709 where a file does not say.
    pub primaries: Primaries,
}

impl Texture {
    /// A two-dimensional texture of one level, without metadata, and what packing changed.
    ///
    /// **Shape**: `values` is height × width × channels, channel fastest.
    ///
    /// **Errors**: another number of values than that.
    pub fn flat<T: Copy + Into<f64> + Sync>(
        format: TexelFormat,
        width: usize,
        height: usize,
        values: &[T],
    ) -> Result<(Self, PackReport)> {
        Self::empty(format, width, height).filled(values)
    }

    /// The same as slices of a three-dimensional texture.
    ///
    /// **Shape**: `values` is depth × height × width × channels, channel fastest.
    ///
    /// **Errors**: another number of values than that.
    pub fn volume<T: Copy + Into<f64> + Sync>(
        format: TexelFormat,
        [width, height, depth]: [usize; 3],
        values: &[T],
    ) -> Result<(Self, PackReport)> {
        Self { depth, ..Self::empty(format, width, height) }.filled(values)
    }

    /// The same as layers of an array.
    ///
    /// **Shape**: `values` is layers × height × width × channels, channel fastest.
    ///
    /// **Errors**: another number of values than that.
    pub fn array<T: Copy + Into<f64> + Sync>(
        format: TexelFormat,
        [width, height, array_layers]: [usize; 3],
        values: &[T],
    ) -> Result<(Self, PackReport)> {
        Self { array_layers, ..Self::empty(format, width, height) }.filled(values)
    }

    /// A two-dimensional texture that has no level yet.
    pub fn empty(format: TexelFormat, width: usize, height: usize) -> Self {
        Self {
            format,
            width,
            height,
            depth: 0,
            array_layers: 0,
            faces: 1,
            levels: vec![],
            channels: vec![],
            metadata: vec![],
            primaries: Primaries::REC709,
        }
    }

    /// A cube map that has no level yet.
    pub fn empty_cube(format: TexelFormat, size: usize) -> Self {
        Self { faces: 6, ..Self::empty(format, size, size) }
    }

    fn filled<T: Copy + Into<f64> + Sync>(mut self, values: &[T]) -> Result<(Self, PackReport)> {
        let report = self.push_level(values)?;
        self.check()?;
        Ok((self, report))
    }

    /// Packs the next level; what that changed.
    ///
    /// **Shape**: `values` is array layers × faces × slices × height × width × channels of that level, channel fastest.
    ///
    /// **Errors**: another number of values than that.
    pub fn push_level<T: Copy + Into<f64> + Sync>(&mut self, values: &[T]) -> Result<PackReport> {
        let level = self.levels.len();
        let [width, height] = self.level_size(level);
        let texels = width.checked_mul(height).and_then(|n| n.checked_mul(self.layers(level)));
        if texels.and_then(|n| n.checked_mul(self.format.channels())) != Some(values.len()) {
            return Err(Error::usage(
                format!(
                    "level {level} of {} with {} values, in {} channels",
                    self.text(),
                    values.len(),
                    self.format.channels()
                ),
                "give a value for each channel of each texel",
            ));
        }
        let (bytes, report) = self.format.pack(width, height, values);
        self.levels.push(bytes);
        Ok(report)
    }

    /// Width and height of a level: halved each time, rounded down, but not below 1.
    pub fn level_size(&self, level: usize) -> [usize; 2] {
        let [width, height, _] = self.level_box(level);
        [width, height]
    }

    /// Width, height and number of slices of a level.
    pub(crate) fn level_box(&self, level: usize) -> [usize; 3] {
        [self.width, self.height, self.depth].map(|size| size.checked_shr(level as u32).unwrap_or(0).max(1))
    }

    /// Pictures that a level consists of: array layers × faces × slices.
    pub fn layers(&self, level: usize) -> usize {
        self.array_layers.max(1).saturating_mul(self.faces).saturating_mul(self.level_box(level)[2])
    }

    /// Bytes of one picture of a level; nothing where that overflows.
    pub(crate) fn picture_bytes(&self, level: usize) -> Option<usize> {
        let [width, height] = self.level_size(level);
        self.format.bytes(width, height)
    }

    /// The packed texels of one picture (array layer × faces or slices + face or slice) of one level; none where there is no such.
    pub fn picture(&self, level: usize, picture: usize) -> Option<&[u8]> {
        let size = self.picture_bytes(level)?;
        self.levels.get(level)?.get(picture.checked_mul(size)?..picture.checked_add(1)?.checked_mul(size)?)
    }

    /// A layer of an array texture as a texture of its own; none where there is no such.
    pub fn layer(&self, layer: usize) -> Option<Self> {
        if layer >= self.array_layers {
            return None;
        }
        let of_level = |level: &Vec<u8>| {
            let size = level.len() / self.array_layers;
            level[layer * size..(layer + 1) * size].to_vec()
        };
        Some(Self { array_layers: 0, levels: self.levels.iter().map(of_level).collect(), ..self.clone() })
    }

    /// The values of one picture, such as a face or a slice, of one level, row by row, channel fastest; none where there is no such.
    pub fn face(&self, level: usize, face: usize) -> Option<Vec<f32>> {
        let [width, height] = self.level_size(level);
        Some(self.format.unpack(width, height, self.picture(level, face)?))
    }

    /// The values of a whole level.
    pub fn values(&self, level: usize) -> Vec<f32> {
        let [width, height] = self.level_size(level);
        self.levels.get(level).map(|bytes| self.format.unpack(width, height, bytes)).unwrap_or_default()
    }

    /// Names of the channels: those given, else R, G, B and A, beyond four by number.
    pub fn channel_names(&self) -> Vec<String> {
        let n = self.format.channels();
        if self.channels.len() == n {
            return self.channels.clone();
        }
        let name = |c: usize| ["R", "G", "B", "A"].get(c).map_or_else(|| format!("channel {c}"), |s| (*s).to_owned());
        (0..n).map(name).collect()
    }

    /// What the metadata says under `key`.
    pub fn metadata(&self, key: &str) -> Option<&str> {
        self.metadata.iter().find(|(known, _)| known == key).map(|(_, value)| value.as_str())
    }

    /// Bytes of a level; nothing where that overflows.
    pub(crate) fn level_bytes(&self, level: usize) -> Option<usize> {
        self.picture_bytes(level)?.checked_mul(self.layers(level))
    }

    /// What it is, in a few words: `a texture of 4 × 4 texels`.
    pub(crate) fn text(&self) -> String {
        let Self { width, height, depth, array_layers, faces, .. } = *self;
        let slices = if depth > 0 { format!(" × {depth}") } else { String::new() };
        let kind = if faces == 6 { "cube" } else { "texture" };
        let layers = if array_layers > 0 { format!(" in {array_layers} layers") } else { String::new() };
        format!("a {kind} of {width} × {height}{slices} texels{layers}")
    }

    /// Refuses what no texture can be.
    ///
    /// **Errors**: sizes, faces or levels that contradict each other; levels of another length than their texels.
    pub(crate) fn check(&self) -> Result<()> {
        let Self { width, height, depth, faces, array_layers, .. } = *self;
        let size = self.text();
        let largest = width.max(height).max(depth);
        if width.min(height) == 0 || largest.max(array_layers) > u32::MAX as usize {
            return Err(Error::usage(size, "give a width and a height from 1 to 4294967295"));
        }
        if faces != 1 && (faces != 6 || width != height || depth > 0) {
            return Err(Error::usage(format!("{size} with {faces} faces"), "give one face, or six square ones"));
        }
        if depth > 0 && array_layers > 0 {
            return Err(Error::usage(format!("{size}, which no interface has"), "give slices or layers, not both"));
        }
        let max_levels = (largest.ilog2() + 1) as usize;
        if !(1..=max_levels).contains(&self.levels.len()) {
            let n = self.levels.len();
            return Err(Error::usage(format!("{size} with {n} mip levels"), format!("give 1 to {max_levels} levels")));
        }
        for (level, bytes) in self.levels.iter().enumerate() {
            let wanted = self.level_bytes(level);
            if wanted != Some(bytes.len()) {
                let wanted = wanted.map_or_else(|| "too many".to_owned(), |n| n.to_string());
                return Err(Error::usage(
                    format!("level {level} of {size} holds {} bytes, where {wanted} are wanted", bytes.len()),
                    "give width × height × faces texels, halving the size at each level",
                ));
            }
        }
        Ok(())
    }

    /// Refuses what a container without mips, faces and layers cannot hold.
    pub(crate) fn check_is_picture(&self, container: &str) -> Result<()> {
        self.check()?;
        if self.levels.len() > 1 || self.layers(0) > 1 {
            let levels =
                if self.levels.len() > 1 { format!(" and {} levels", self.levels.len()) } else { String::new() };
            return Err(Error::unsupported(
                format!("{}{levels} in {container}, which holds one picture", self.text()),
                "use ktx2, ktx1 or dds",
            ));
        }
        Ok(())
    }
}
