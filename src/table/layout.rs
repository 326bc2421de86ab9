//! Where the texels of a table over three axes lie in a file.
//!
//! This is the only place that knows it: the writer scatters by it, and the reader gathers.

use super::bake::TableSpec;
use crate::error::{Error, Result};
use crate::format::{Container, FormatSpec};
use crate::math::expression::Expression;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// How the slices of a table, one per texel of its third axis, are arranged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Layout {
    /// A three-dimensional texture (KTX2, KTX1, DDS), or an array of three axes and the channels (NPY, raw, source code).
    Volume,
    /// A layer of channels per slice, `slice00.` and so on (EXR).
    Slices,
    /// Side by side in one picture, row by row from the top left; what is left over is 0.
    Atlas {
        /// Slices in a row; 0 is as many as make the picture nearly square.
        columns: usize,
    },
}

impl Layout {
    /// The layout that a container has for three axes unless told otherwise.
    pub fn of(format: FormatSpec) -> Self {
        match format.container() {
            Container::Exr => Self::Slices,
            container if container.has_volumes() => Self::Volume,
            _ => Self::Atlas { columns: 0 },
        }
    }
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Volume => f.write_str("volume"),
            Self::Slices => f.write_str("slices"),
            Self::Atlas { columns: 0 } => f.write_str("atlas"),
            Self::Atlas { columns } => write!(f, "atlas:{columns}"),
        }
    }
}

impl FromStr for Layout {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let columns = text.strip_prefix("atlas:").and_then(|n| n.parse().ok()).filter(|&n| n > 0);
        match (text, columns) {
            ("volume", _) => Ok(Self::Volume),
            ("slices", _) => Ok(Self::Slices),
            ("atlas", _) => Ok(Self::Atlas { columns: 0 }),
            (_, Some(columns)) => Ok(Self::Atlas { columns }),
            _ => Err(Error::usage(
                format!("no layout is called {text:?}"),
                "use volume, slices, atlas or atlas:COLUMNS, such as atlas:4",
            )),
        }
    }
}

impl TryFrom<String> for Layout {
    type Error = Error;

    fn try_from(text: String) -> Result<Self> {
        text.parse()
    }
}

impl From<Layout> for String {
    fn from(layout: Layout) -> Self {
        layout.to_string()
    }
}

/// The shape of a table in its file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Arrangement {
    /// Texels of the table along x, y and z.
    table: [usize; 3],
    /// Channels of the table.
    channels: usize,
    /// Slices that lie side by side; 1 unless it is an atlas.
    columns: usize,
    /// Slices that share a texel, as layers of channels; 1 unless they are layers.
    layers: usize,
    /// Whether the file is a three-dimensional texture, be it one slice deep.
    volume: bool,
    /// Texels of the file along x, y and z.
    pub size: [usize; 3],
}

impl Arrangement {
    /// How a table lies in a file of that format; `layout` matters for three axes only.
    ///
    /// **Errors**: a layout that the container does not have.
    pub fn new(spec: &TableSpec, format: FormatSpec, layout: Option<Layout>) -> Result<Self> {
        let table = [spec.width(), spec.height(), spec.depth()];
        let [width, height, depth] = table;
        let channels = spec.channels.len();
        let whole = Self { table, channels, columns: 1, layers: 1, volume: false, size: table };
        if spec.axes.len() < 3 {
            return match layout {
                None => Ok(whole),
                Some(layout) => Err(Error::usage(
                    format!("layout {layout} for a table of {} axes", spec.axes.len()),
                    "leave the layout out, or add a third axis",
                )),
            };
        }
        match (layout.unwrap_or(Layout::of(format)), format.container()) {
            (Layout::Volume, container) if container.has_volumes() => Ok(Self { volume: true, ..whole }),
            (Layout::Slices, Container::Exr) => Ok(Self { layers: depth, size: [width, height, 1], ..whole }),
            (Layout::Atlas { columns }, _) => {
                // Nearly square in texels: as many columns as rows, corrected for the shape of a slice.
                let square = ((depth * height) as f64 / width as f64).sqrt().round() as usize;
                let columns = if columns == 0 { square } else { columns }.clamp(1, depth);
                Ok(Self { columns, size: [columns * width, depth.div_ceil(columns) * height, 1], ..whole })
            }
            (layout, _) => Err(Error::usage(
                format!("{format} has no layout {layout}"),
                format!("use --layout {} or atlas", Layout::of(format)),
            )),
        }
    }

    /// Whether the file is a three-dimensional texture.
    pub fn is_volume(&self) -> bool {
        self.volume
    }

    /// Whether slices are layers of channels.
    pub fn is_layered(&self) -> bool {
        self.layers > 1
    }

    /// Whether slices lie side by side in a picture, and a shader has to blend them itself.
    pub fn is_atlas(&self) -> bool {
        self.size[2] == 1 && self.table[2] > 1 && self.layers == 1
    }

    /// Where in the picture a place of one slice lies, as shader code: the texture coordinates of the place (`u`, `v`) of slice
    /// `slice`, counted from 0, both kept half a texel within the slice so that filtering stays inside it.
    pub fn atlas_coordinate(&self, [u, v, slice]: [Expression; 3]) -> [Expression; 2] {
        let columns = self.columns as f64;
        // The half keeps rounding from reaching the row before.
        let row = if self.columns == 1 { slice.clone() } else { ((slice.clone() + 0.5) / columns).floor() };
        let column = if self.columns == 1 { 0.0.into() } else { slice - row.clone() * columns };
        let place = |t: Expression, tile: Expression, n: usize, size: usize| {
            let n = n as f64;
            ((t * n).clamp(0.5, n - 0.5) + tile * n) * (1.0 / size as f64)
        };
        [place(u, column, self.table[0], self.size[0]), place(v, row, self.table[1], self.size[1])]
    }

    /// Channels of the file.
    pub fn file_channels(&self) -> usize {
        self.channels * self.layers
    }

    /// The names of the file's channels, given the table's.
    pub fn names(&self, table: &[&str]) -> Vec<String> {
        if self.layers == 1 {
            return table.iter().map(|&name| name.to_owned()).collect();
        }
        let digits = (self.layers - 1).to_string().len().max(2);
        (0..self.layers).flat_map(|z| table.iter().map(move |name| format!("slice{z:0digits$}.{name}"))).collect()
    }

    /// Where the first channel of texel `index` (x fastest) lies among the file's values.
    fn position(&self, index: usize) -> usize {
        let [width, height, _] = self.table;
        let (x, y, z) = (index % width, index / width % height, index / (width * height));
        if self.layers > 1 {
            return (y * width + x) * self.file_channels() + z * self.channels;
        }
        // In a volume, and in an atlas of one column, slice follows slice.
        let (row, column) = (z / self.columns * height + y, z % self.columns * width + x);
        (row * self.size[0] + column) * self.channels
    }

    /// The file's values, x fastest after the channels, from the table's; 0 where the table has nothing.
    pub fn scatter<T: Copy + Default>(&self, table: &[T]) -> Vec<T> {
        let mut file = vec![T::default(); self.size.iter().product::<usize>() * self.file_channels()];
        for (index, texel) in table.chunks_exact(self.channels).enumerate() {
            let at = self.position(index);
            file[at..at + self.channels].copy_from_slice(texel);
        }
        file
    }

    /// The table's values from the file's: the inverse of [`Arrangement::scatter`].
    pub fn gather<T: Copy>(&self, file: &[T]) -> Vec<T> {
        let texels = self.table.iter().product::<usize>();
        (0..texels)
            .flat_map(|index| self.position(index)..self.position(index) + self.channels)
            .map(|i| file[i])
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::quantity;

    fn spec(sizes: &str) -> TableSpec {
        let axes = sizes.split(',').map(|a| a.parse().unwrap()).collect();
        let channels = ["dielectric.reflectance", "dielectric.transmittance"].map(|n| quantity::find(n).unwrap());
        TableSpec { channels: channels.into(), axes, ..TableSpec::default() }
    }

    #[test]
    fn gathering_undoes_scattering_in_every_layout() {
        let spec = spec("mu:3,alpha:4,eta:5:1..2");
        for (format, layouts) in
            [("ktx2:rg16f", ["volume", "atlas", "atlas:2"]), ("exr:f32", ["slices", "atlas", "atlas:9"])]
        {
            for layout in layouts {
                let arrangement =
                    Arrangement::new(&spec, format.parse().unwrap(), Some(layout.parse().unwrap())).unwrap();
                let table: Vec<f32> = (0..120).map(|i| i as f32).collect();
                let file = arrangement.scatter(&table);
                assert_eq!(file.len(), arrangement.size.iter().product::<usize>() * arrangement.file_channels());
                assert_eq!(arrangement.gather(&file), table, "{format} {layout}");
            }
        }
    }

    #[test]
    fn an_atlas_has_its_slices_row_by_row() {
        let arrangement = Arrangement::new(
            &spec("mu:3,alpha:4,eta:5:1..2"),
            "exr".parse().unwrap(),
            Some("atlas:2".parse().unwrap()),
        )
        .unwrap();
        assert_eq!(arrangement.size, [6, 12, 1]);
        let table: Vec<usize> = (0..60).flat_map(|texel| [texel / 12; 2]).collect(); // the number of the slice
        let file = arrangement.scatter(&table);
        let slice = |x: usize, y: usize| file[(y * 6 + x) * 2];
        assert_eq!([slice(0, 0), slice(3, 0), slice(0, 4), slice(5, 7), slice(2, 11)], [0, 1, 2, 3, 4]);
    }

    #[test]
    fn the_code_of_an_atlas_finds_every_texel() {
        for layout in ["atlas:1", "atlas:2", "atlas:5"] {
            let arrangement = Arrangement::new(
                &spec("mu:3,alpha:4,eta:5:1..2"),
                "exr".parse().unwrap(),
                Some(layout.parse().unwrap()),
            )
            .unwrap();
            assert!(arrangement.is_atlas());
            let [x, y] = arrangement.atlas_coordinate(["u", "v", "slice"].map(Expression::variable));
            for index in 0..60 {
                let place = |name: &str| match name {
                    "u" => ((index % 3) as f64 + 0.5) / 3.0,
                    "v" => ((index / 3 % 4) as f64 + 0.5) / 4.0,
                    _ => (index / 12) as f64,
                };
                let texel = [&x, &y].map(|e| e.evaluate(&place)).into_iter().zip(arrangement.size);
                let [column, row] = texel.map(|(t, n)| t * n as f64 - 0.5).collect::<Vec<_>>().try_into().unwrap();
                let found = (row * arrangement.size[0] as f64 + column) * 2.0;
                assert!((found - arrangement.position(index) as f64).abs() < 1e-9, "{layout}, texel {index}: {found}");
            }
        }
    }

    #[test]
    fn slices_are_layers_with_names() {
        let arrangement = Arrangement::new(&spec("mu:3,alpha:4,eta:5:1..2"), "exr".parse().unwrap(), None).unwrap();
        assert_eq!(arrangement.names(&["a.b", "c"])[..3], ["slice00.a.b", "slice00.c", "slice01.a.b"]);
        assert_eq!((arrangement.size, arrangement.file_channels()), ([3, 4, 1], 10));
    }

    #[test]
    fn layouts_that_a_container_does_not_have_are_refused() {
        let three = spec("mu:3,alpha:4,eta:5:1..2");
        let refuse = |spec: &TableSpec, format: &str, layout: &str| {
            Arrangement::new(spec, format.parse().unwrap(), Some(layout.parse().unwrap())).unwrap_err().to_string()
        };
        assert!(refuse(&three, "exr", "volume").contains("--layout slices or atlas"));
        assert!(refuse(&three, "ktx2:rg16f", "slices").contains("--layout volume or atlas"));
        assert!(refuse(&spec("mu:3,alpha:4"), "exr", "atlas").contains("2 axes"));
        assert!("atlas:0".parse::<Layout>().is_err());
    }
}
