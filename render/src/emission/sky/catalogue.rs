//! Stars of a catalogue: points whose light a point-spread function spreads over pixels.

use super::beam::Beam;
use super::cells::Cells;
use crate::Error;
use crate::emission::black_body::BlackBody;
use crate::scene::StarCatalogue;

/// A star.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CatalogueStar {
    /// Unit vector towards it.
    pub direction: [f64; 3],
    /// Linear colour times its light, in that of a white star of magnitude 0.
    pub light: [f32; 3],
}

/// A decoded catalogue.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Catalogue {
    stars: Vec<CatalogueStar>,
    warnings: Vec<String>,
}

/// Reason why a text is no catalogue.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CatalogueError {
    /// The text is not UTF-8.
    #[error("a catalogue of stars is a text in UTF-8")]
    Text,
    /// The first line lacks a column.
    #[error(
        "the first line names no column {0}: columns are lon, lat (or ra, dec) in degrees, magnitude (or mag, vmag) and, \
         if there is one, color_index (or bv)"
    )]
    Column(&'static str),
    /// Two columns tell the same.
    #[error("the first line names two columns that tell {0}: one of them is expected")]
    Twice(&'static str),
    /// A line has more columns than names, as numbers with decimal commas make it.
    #[error("line {line}: {columns} columns, but {names} names")]
    Columns {
        /// Line of the file, from 1.
        line: usize,
        /// Number of columns.
        columns: usize,
        /// Number of names in the first line.
        names: usize,
    },
    /// A value is no number or out of range.
    #[error("line {line}: {column} = {value:?} is not allowed: {allowed}")]
    Value {
        /// Line of the file, from 1.
        line: usize,
        /// The column.
        column: &'static str,
        /// Value in the file.
        value: String,
        /// Values that are allowed.
        allowed: &'static str,
    },
}

/// Names of the columns, and where they are.
const COLUMNS: [&[&str]; 4] = [
    &["lon", "longitude", "ra", "ra_deg"],
    &["lat", "latitude", "dec", "dec_deg"],
    &["magnitude", "mag", "vmag"],
    &["color_index", "bv", "b-v", "ci"],
];

/// A line of a catalogue with the places of its columns.
struct Line<'a> {
    number: usize,
    fields: Vec<&'a str>,
    places: [Option<usize>; 4],
}

impl Line<'_> {
    /// A number; nothing where the column is not there or empty.
    fn number(
        &self,
        column: usize,
        [least, most]: [f64; 2],
        allowed: &'static str,
    ) -> Result<Option<f64>, CatalogueError> {
        let place = self.places[column].and_then(|place| self.fields.get(place));
        let Some(text) = place.filter(|text| !text.is_empty()) else { return Ok(None) };
        match text.parse::<f64>() {
            Ok(value) if (least..=most).contains(&value) => Ok(Some(value)),
            _ => Err(self.wrong(column, text, allowed)),
        }
    }

    /// A number that must be there.
    fn needed(
        &self,
        column: usize,
        range: [f64; 2],
        allowed: &'static str,
    ) -> Result<f64, CatalogueError> {
        self.number(column, range, allowed)?.ok_or_else(|| self.wrong(column, "", allowed))
    }

    fn wrong(&self, column: usize, value: &str, allowed: &'static str) -> CatalogueError {
        let (line, column, value) = (self.number, COLUMNS[column][0], value.to_owned());
        CatalogueError::Value { line, column, value, allowed }
    }

    /// The star of a line; what is odd about it where it has no light that is known.
    fn star(&self) -> Result<Result<CatalogueStar, Odd>, CatalogueError> {
        let lon = self.needed(0, [-360.0, 360.0], "an angle in [-360, 360]")?.to_radians();
        let lat = self.needed(1, [-90.0, 90.0], "an angle in [-90, 90]")?.to_radians();
        let magnitude = self.number(2, [-30.0, 40.0], "a magnitude in [-30, 40]")?;
        let Some(magnitude) = magnitude else { return Ok(Err(Odd::Magnitude)) };
        // Any finite number is read: one out of range leaves out its star, not the file.
        let index = self.number(3, [f64::MIN, f64::MAX], "a colour index B - V")?;
        if index.is_some_and(|index| !COLOR_INDEX.contains(&index)) {
            return Ok(Err(Odd::ColorIndex));
        }
        let direction = [lat.cos() * lon.cos(), lat.cos() * lon.sin(), lat.sin()];
        let light = 10f64.powf(-0.4 * magnitude);
        let tint = index.map_or([1.0; 3], tint);
        Ok(Ok(CatalogueStar { direction, light: tint.map(|c| (light * f64::from(c)) as f32) }))
    }
}

/// Colour indices B − V for which a temperature is known.
const COLOR_INDEX: core::ops::RangeInclusive<f64> = -0.6..=6.0;

/// Reason why a star is left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Odd {
    Magnitude,
    ColorIndex,
}

impl Odd {
    fn describe(self) -> &'static str {
        match self {
            Odd::Magnitude => "have no magnitude",
            Odd::ColorIndex => "have a colour index B - V outside of [-0.6, 6]",
        }
    }
}

/// Linear colour of luminance 1 of a star with a colour index B − V, by the temperature of Ballesteros (2012, EPL 97,
/// 34008, eq. 14).
fn tint(index: f64) -> [f32; 3] {
    let temperature = 4600.0 * (1.0 / (0.92 * index + 1.7) + 1.0 / (0.92 * index + 0.62));
    BlackBody::at(temperature)
}

impl Catalogue {
    /// Reads a table with commas between its columns, whose first line names them; lines that are empty or begin with #
    /// are left out, as are stars without a magnitude or with a colour index for which there is no temperature.
    ///
    /// # Errors
    /// If a column is missing or a value is no number in its range.
    pub fn decode(bytes: &[u8]) -> Result<Self, Error> {
        let text = core::str::from_utf8(bytes).map_err(|_| CatalogueError::Text)?;
        let text = text.trim_start_matches('\u{feff}');
        let lines = text.lines().enumerate().map(|(k, line)| (k + 1, line.trim()));
        let mut lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
        let (_, names) = lines.next().unwrap_or_default();
        let names: Vec<String> = names.split(',').map(|x| x.trim().to_ascii_lowercase()).collect();
        let places = COLUMNS.map(|known| names.iter().position(|name| known.contains(&&**name)));
        if let Some(missing) = (0..3).find(|k| places[*k].is_none()) {
            return Err(CatalogueError::Column(COLUMNS[missing][0]).into());
        }
        let tells = |k: usize| names.iter().filter(|name| COLUMNS[k].contains(&&***name)).count();
        if let Some(twice) = (0..COLUMNS.len()).find(|k| tells(*k) > 1) {
            return Err(CatalogueError::Twice(COLUMNS[twice][0]).into());
        }
        let star = |(number, line): (usize, &str)| {
            let fields: Vec<&str> = line.split(',').map(str::trim).collect();
            let columns = fields.iter().rposition(|field| !field.is_empty()).map_or(0, |k| k + 1);
            if columns > names.len() {
                return Err(CatalogueError::Columns { line: number, columns, names: names.len() });
            }
            Line { number, fields, places }.star()
        };
        let (mut catalogue, mut odd) = (Catalogue::default(), Vec::new());
        for (number, line) in lines {
            match star((number, line))? {
                Ok(star) => catalogue.stars.push(star),
                Err(why) => odd.push((number, why)),
            }
        }
        for kind in [Odd::Magnitude, Odd::ColorIndex] {
            let mut lines = odd.iter().filter(|(_, why)| *why == kind);
            if let Some((first, _)) = lines.next() {
                let (count, why) = (1 + lines.count(), kind.describe());
                let told =
                    format!("stars that {why} are left out: {count}, the first on line {first}");
                catalogue.warnings.push(told);
            }
        }
        Ok(catalogue)
    }

    /// Names the stars that are left out.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The stars, in the order of the file.
    pub fn stars(&self) -> &[CatalogueStar] {
        &self.stars
    }
}

/// A catalogue as sky.
#[derive(Debug, Clone)]
pub struct CatalogueSky {
    cells: Cells,
    /// Begin of the stars of each cell; one more than cells.
    starts: Vec<usize>,
    stars: Vec<CatalogueStar>,
    /// Light of magnitude 0, scene units × sr.
    flux: f64,
}

impl CatalogueSky {
    pub(super) fn new(settings: &StarCatalogue, Catalogue { mut stars, .. }: Catalogue) -> Self {
        let cells = Cells::about((stars.len() as f64).clamp(32.0, 1e6));
        stars.sort_by_key(|star| cells.holding(star.direction));
        let before = |k| stars.partition_point(|star| cells.holding(star.direction) < k);
        let starts = (0..=cells.count()).map(before).collect();
        let flux = settings.brightness * 1f64.to_radians().powi(2);
        CatalogueSky { cells, starts, stars, flux }
    }

    /// Mean brightness over a beam, which is the point-spread function seen on the sky.
    pub(super) fn mean_color(&self, beam: &Beam) -> [f32; 3] {
        let (peak, mut color) = (self.flux * beam.peak_density(), [0.0; 3]);
        self.cells.near(beam.direction(), beam.reach(), |ring, sector| {
            let cell = (ring * self.cells.sectors + sector) as usize;
            for star in &self.stars[self.starts[cell]..self.starts[cell + 1]] {
                let part = (peak * beam.weight(star.direction)) as f32;
                color.iter_mut().zip(star.light).for_each(|(sum, light)| *sum += part * light);
            }
        });
        color
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::LUMINANCE;
    use kerrlight_geodesic::vector::dot;

    #[test]
    fn exact_stars_of_a_table() {
        let text = "# bright stars\nname, RA, dec, Vmag, BV\nA, 90, 0, 0, \nB,0,90,5,0.65\n\nC,180,-30,-2.5,1.5\n";
        let stars = Catalogue::decode(text.as_bytes()).unwrap().stars;
        assert_eq!(stars.len(), 3);
        let near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(near(stars[0].direction, [0.0, 1.0, 0.0]) && stars[0].light == [1.0; 3]);
        assert!(near(stars[1].direction, [0.0, 0.0, 1.0]));
        let luminance = |c: [f32; 3]| dot(LUMINANCE, c.map(f64::from));
        assert!((luminance(stars[1].light) - 0.01).abs() < 2e-4, "{:?}", stars[1]);
        assert!((luminance(stars[2].light) - 10.0).abs() < 0.2);
        // The Sun is white with a little red, a giant redder.
        let [sun, giant] = [stars[1].light, stars[2].light].map(|c| c[0] / c[2]);
        assert!((1.0..1.6).contains(&sun) && giant > 1.8, "{sun} {giant}");
    }

    #[test]
    fn exact_refusals_name_line_and_column() {
        let fail = |text: &str| Catalogue::decode(text.as_bytes()).unwrap_err().to_string();
        assert!(fail("lon,lat\n1,2\n").contains("no column magnitude"));
        assert!(fail("lon,lat,ra,mag\n1,2,3,4\n").contains("two columns that tell lon"));
        assert!(fail("lon,lat,mag,lat\n1,2,3,4\n").contains("two columns that tell lat"));
        assert!(fail("lon,lat,mag\n1,2,3,\n4,5,0,6\n").contains("line 3: 4 columns, but 3 names"));
        let said = fail("lon,lat,mag\n1,2,3\n4,95,6\n");
        assert!(said.starts_with("line 3: lat = \"95\" is not allowed"), "{said}");
        assert!(fail("lon,lat,mag,bv\n1,2,3,nan\n").contains("color_index = \"nan\""));
        assert!(fail("lon,lat,mag\n1,2,bright\n").contains("magnitude = \"bright\""));
        assert!(Catalogue::decode(&[0xff, 0xfe]).is_err());
    }

    #[test]
    fn exact_odd_stars_are_left_out_and_counted() {
        let text = "\u{feff}lon,lat,mag,bv\n1,2,3,0.5\n1,2,,0.5\n3,4,5,-7\n1,2,,\n";
        let catalogue = Catalogue::decode(text.as_bytes()).unwrap();
        assert_eq!(catalogue.stars.len(), 1);
        let expected = [
            "stars that have no magnitude are left out: 2, the first on line 3",
            "stars that have a colour index B - V outside of [-0.6, 6] are left out: 1, the first on line 4",
        ];
        assert_eq!(catalogue.warnings(), expected);
    }

    /// Every star is found, wherever beams lie: side by side they have all of its light.
    #[test]
    fn exact_light_of_all_stars() {
        let star = |k: u32| format!("{},{},{}\n", 37 * k % 360, f64::from(k % 179) - 89.0, k % 5);
        let text: String = (0..200).map(star).collect();
        let catalogue = Catalogue::decode(format!("lon,lat,mag\n{text}").as_bytes()).unwrap();
        let expected: f64 = catalogue.stars.iter().map(|star| f64::from(star.light[1])).sum();
        let settings = StarCatalogue { path: String::new(), brightness: 1.0, psf_fwhm_pixels: 2.0 };
        let sky = CatalogueSky::new(&settings, catalogue);
        // A net of directions of equal solid angles (Fibonacci), and beams a few steps wide.
        let (count, mut sum) = (100_000, 0.0);
        let area = 4.0 * core::f64::consts::PI / f64::from(count);
        for k in 0..count {
            let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(count);
            let azimuth = f64::from(k) * 2.399_963_229_728_653;
            let s = (1.0 - z * z).sqrt();
            let beam = Beam::of_circle([s * azimuth.cos(), s * azimuth.sin(), z], 0.015);
            sum += area * f64::from(sky.mean_color(&beam)[1]);
        }
        sum /= 1f64.to_radians().powi(2);
        assert!((sum / expected - 1.0).abs() < 2e-3, "{sum} {expected}");
    }
}
