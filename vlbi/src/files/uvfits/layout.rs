//! Layout of a random group.

use super::super::FileError;
use super::super::fits::{Header, stored};
use crate::observation::Basis;

/// The parameters, and what they number (AIPS memo 117, table 5).
pub const SELECTORS: [(&str, &str); 5] = [
    ("SOURCE", "sources"),
    ("FREQSEL", "frequency setups"),
    ("GATEID", "pulsar gates"),
    ("FILTER", "filters"),
    ("CORR-ID", "correlations"),
];

/// A random parameter: value = stored·scale + zero.
#[derive(Debug, Clone, Copy)]
pub struct Parameter {
    pub index: usize,
    pub scale: f64,
    pub zero: f64,
}

/// Parameters that name the stations of a baseline.
#[derive(Debug, Clone, Copy)]
pub enum Antennas {
    /// 256·first + second + (subarray − 1)/100, or 65536 + 2048·first + second.
    Baseline(Parameter),
    /// Two parameters, and perhaps one for the subarray.
    Pair(Parameter, Parameter, Option<Parameter>),
}

/// The layout of groups.
#[derive(Debug)]
pub struct Layout {
    /// Bytes of a stored number.
    pub number_size: usize,
    float: bool,
    /// Numbers of a group, parameters first.
    pub group_size: usize,
    parameters: usize,
    pub groups: usize,
    /// Parts of u, to be added, seconds.
    pub u: Vec<Parameter>,
    pub v: Vec<Parameter>,
    /// Those of [`SELECTORS`] that there are.
    selectors: Vec<(&'static str, Parameter)>,
    pub antennas: Antennas,
    /// Parts of the date, to be added.
    pub date: Vec<Parameter>,
    pub integration: Option<Parameter>,
    pub opacity: Option<[Parameter; 2]>,
    scale: f64,
    zero: f64,
    /// The whole number that stands for no value.
    blank: Option<i64>,
    /// Distance in numbers between real part, imaginary part and weight.
    complex_stride: usize,
    /// True if there are weights.
    pub weighted: bool,
    /// Places of the four products; `None` where there is none.
    pub products: [Option<usize>; 4],
    /// Distance of neighbours on the axis of polarisations.
    product_stride: usize,
    pub basis: Basis,
    /// Places of spectral channels of all IFs.
    pub channels: Vec<Place>,
    /// Frequency in Hz at the reference channel, that channel (counted from 1), distance of channels.
    pub frequency_hz: f64,
    pub reference_channel: f64,
    pub channel_width_hz: f64,
}

/// A spectral channel's place in a group.
#[derive(Debug, Clone, Copy, Default)]
pub struct Place {
    /// Relative to the first one's.
    pub offset: usize,
    /// Its IF, counted from 0.
    pub band: usize,
    /// Its number in the IF, counted from 0.
    pub channel: usize,
}

/// An axis of the data, with its position in memory.
struct Axis {
    keyword: usize,
    name: String,
    length: usize,
    stride: usize,
}

impl Layout {
    /// The layout that a primary header tells.
    pub fn new(header: &Header<'_>) -> Result<Self, FileError> {
        if !header.is_true("GROUPS") || header.axes()?.first() != Some(&0) {
            let message =
                "a FITS file, but not of random groups (GROUPS = T, NAXIS1 = 0): no UVFITS";
            return Err(FileError::whole(message));
        }
        let parameters = header.count("PCOUNT", 1, 10_000)?;
        let axes = axes(header)?;
        let numbers = header.group_size()?;
        let bits = header.integer("BITPIX")?;
        if !matches!(bits, Some(16 | 32 | -32 | -64)) {
            return Err(header.error("BITPIX", "16, 32, -32 or -64 in UVFITS"));
        }
        let complex = find(&axes, "COMPLEX", header)?;
        if complex.length != 2 && complex.length != 3 {
            return Err(header.error(&format!("NAXIS{}", complex.keyword), "2 or 3 (COMPLEX)"));
        }
        let stokes = find(&axes, "STOKES", header)?;
        let (products, basis) = products(header, stokes)?;
        let frequency = find(&axes, "FREQ", header)?;
        let at = |name: &str, default| {
            header.number_or(&format!("{name}{}", frequency.keyword), default)
        };
        let parameter = Parameters::read(header, parameters)?;
        parameter.check_projection()?;
        parameter.check_once()?;
        let selector = |(name, _)| Some((name, parameter.optional(name)?));
        Ok(Layout {
            number_size: header.number_size()?,
            float: bits < Some(0),
            group_size: numbers + parameters,
            parameters,
            groups: header.count("GCOUNT", 1, usize::MAX)?,
            u: parameter.all("UU")?,
            v: parameter.all("VV")?,
            selectors: SELECTORS.into_iter().filter_map(selector).collect(),
            antennas: parameter.antennas()?,
            date: parameter.all("DATE")?,
            integration: parameter.optional("INTTIM"),
            opacity: parameter
                .optional("TAU1")
                .zip(parameter.optional("TAU2"))
                .map(|(a, b)| [a, b]),
            scale: header.number_or("BSCALE", 1.0)?,
            zero: header.number_or("BZERO", 0.0)?,
            // The standard has BLANK for whole numbers alone.
            blank: header.integer("BLANK")?.filter(|_| bits > Some(0)),
            complex_stride: complex.stride,
            weighted: complex.length == 3,
            products,
            product_stride: stokes.stride,
            basis,
            channels: channels(&axes, header)?,
            frequency_hz: at("CRVAL", 0.0)?,
            reference_channel: at("CRPIX", 1.0)?,
            channel_width_hz: at("CDELT", 0.0)?,
        })
    }

    /// Number `index` of a group.
    fn stored(&self, group: &[u8], index: usize) -> f64 {
        let cell = &group[index * self.number_size..(index + 1) * self.number_size];
        stored(self.float, cell)
    }

    /// The sum of the parts of a parameter.
    pub fn sum(&self, group: &[u8], parts: &[Parameter]) -> f64 {
        parts.iter().map(|part| self.parameter(group, *part)).sum()
    }

    /// A parameter of a group.
    pub fn parameter(&self, group: &[u8], parameter: Parameter) -> f64 {
        self.stored(group, parameter.index) * parameter.scale + parameter.zero
    }

    /// Real part, imaginary part and weight of the datum at `index` of a group.
    pub fn datum(&self, group: &[u8], index: usize) -> [f64; 3] {
        let value = |k: usize| {
            let stored = self.stored(group, self.parameters + index + k * self.complex_stride);
            match self.blank {
                Some(blank) if stored == blank as f64 => f64::NAN,
                _ => stored * self.scale + self.zero,
            }
        };
        [value(0), value(1), if self.weighted { value(2) } else { 1.0 }]
    }

    /// Parameter of a group that tells sources, setups and the like apart, if it has it.
    pub fn selected(&self, group: &[u8], name: &str) -> Option<i64> {
        Some(self.parameter(group, self.selector(name)?) as i64)
    }

    /// The parameter of [`SELECTORS`] with a name, if there is one.
    pub fn selector(&self, name: &str) -> Option<Parameter> {
        self.selectors.iter().find(|(known, _)| *known == name).map(|(_, parameter)| *parameter)
    }

    /// Place of a datum on the axis of polarisations.
    pub fn place_of_product(&self, start: usize) -> usize {
        start / self.product_stride
    }

    /// Returns whether any product of any channel was measured.
    pub fn has_datum(&self, group: &[u8]) -> bool {
        let starts = || self.products.iter().flatten();
        self.channels
            .iter()
            .any(|place| starts().any(|start| is_measured(self.datum(group, start + place.offset))))
    }
}

/// Returns whether real part, imaginary part and weight are those of a datum.
pub fn is_measured([re, im, weight]: [f64; 3]) -> bool {
    re.is_finite() && im.is_finite() && weight > 0.0
}

fn axes(header: &Header<'_>) -> Result<Vec<Axis>, FileError> {
    let lengths = header.axes()?;
    let mut stride = 1usize;
    let mut axes = Vec::new();
    for (keyword, length) in (2..).zip(lengths.into_iter().skip(1)) {
        let name = header.text(&format!("CTYPE{keyword}")).unwrap_or_default();
        axes.push(Axis { keyword, name, length, stride });
        // No overflow: `Header::group_size` has multiplied them all.
        stride = stride.saturating_mul(length);
    }
    match axes.iter().find(|axis| axis.length == 0) {
        Some(axis) => Err(header.error(&format!("NAXIS{}", axis.keyword), "positive")),
        None => Ok(axes),
    }
}

fn find<'a>(axes: &'a [Axis], name: &str, header: &Header<'_>) -> Result<&'a Axis, FileError> {
    axes.iter()
        .find(|axis| axis.name == name)
        .ok_or_else(|| header.error("CTYPE2", format!("no axis is named {name}")))
}

/// Returns the places of the four products along the axis of polarisations.
fn products(header: &Header<'_>, axis: &Axis) -> Result<([Option<usize>; 4], Basis), FileError> {
    let k = axis.keyword;
    let value = |name: &str, default| header.number_or(&format!("{name}{k}"), default);
    let (first, step, reference) =
        (value("CRVAL", f64::NAN)?, value("CDELT", 1.0)?, value("CRPIX", 1.0)?);
    let circular = first + (1.0 - reference) * step < 0.0;
    let mut products = [None; 4];
    // There are four products, each once: a fifth is refused, however many a header claims.
    for index in 0..axis.length.min(8) {
        let code = first + (index as f64 + 1.0 - reference) * step;
        let code = if circular { -code } else { code };
        let product = (1..=4).find(|k| f64::from(*k) == code);
        let Some(product) = product else {
            let message = "Stokes I, Q, U, V (1 to 4) or circular RR, LL, RL, LR (-1 to -4)";
            return Err(header.error(&format!("CRVAL{k}"), message));
        };
        if products[product as usize - 1].replace(index * axis.stride).is_some() {
            return Err(header.error(&format!("CDELT{k}"), "-1 or 1: each product once"));
        }
    }
    Ok((products, if circular { Basis::Circular } else { Basis::Stokes }))
}

/// Returns the places of channels of all IFs; other axes must not be longer than 1.
fn channels(axes: &[Axis], header: &Header<'_>) -> Result<Vec<Place>, FileError> {
    let mut channels = vec![Place::default()];
    for axis in axes {
        match axis.name.as_str() {
            "COMPLEX" | "STOKES" => {}
            "FREQ" | "IF" => {
                let is_band = axis.name == "IF";
                let at = |k: usize, place: &Place| Place {
                    offset: place.offset + k * axis.stride,
                    band: if is_band { k } else { place.band },
                    channel: if is_band { place.channel } else { k },
                };
                // As many as a group has numbers at most, which the file has.
                channels = (0..axis.length)
                    .flat_map(|k| channels.iter().map(move |place| at(k, place)))
                    .collect();
            }
            _ if axis.length == 1 => {}
            _ => return Err(header.error(&format!("NAXIS{}", axis.keyword), "1 of this axis")),
        }
    }
    Ok(channels)
}

/// The random parameters by name.
struct Parameters<'a, 'b> {
    header: &'a Header<'b>,
    named: Vec<(String, Parameter)>,
}

impl<'a, 'b> Parameters<'a, 'b> {
    fn read(header: &'a Header<'b>, count: usize) -> Result<Self, FileError> {
        let mut named = Vec::new();
        for k in 1..=count {
            // Later parts of a date or of (u, v) may be named `_DATE`.
            let Some(name) = header.text(&format!("PTYPE{k}")) else { continue };
            let name = name.trim_start_matches('_').to_owned();
            let scale = header.number_or(&format!("PSCAL{k}"), 1.0)?;
            if scale == 0.0 {
                return Err(header.error(&format!("PSCAL{k}"), "any number but 0"));
            }
            let zero = header.number_or(&format!("PZERO{k}"), 0.0)?;
            named.push((name, Parameter { index: k - 1, scale, zero }));
        }
        Ok(Parameters { header, named })
    }

    fn optional(&self, name: &str) -> Option<Parameter> {
        self.named.iter().find(|(n, _)| n == name).map(|(_, p)| *p)
    }

    /// The parts of a parameter whose name starts so: `UU` may be `UU---SIN`, `UU-L`, …. Parameters of one name are to be added
    /// (FITS standard 4.0, section 6.1.2).
    fn all(&self, start: &str) -> Result<Vec<Parameter>, FileError> {
        let is_part = |name: &str| name == start || start != "DATE" && name.starts_with(start);
        let parts: Vec<_> =
            self.named.iter().filter(|(n, _)| is_part(n)).map(|(_, p)| *p).collect();
        if parts.is_empty() { Err(self.missing(start)) } else { Ok(parts) }
    }

    /// Refuses numbers in parts that nobody writes in parts.
    fn check_once(&self) -> Result<(), FileError> {
        let others = ["BASELINE", "ANTENNA1", "ANTENNA2", "SUBARRAY", "INTTIM", "TAU1", "TAU2"];
        for name in SELECTORS.map(|(name, _)| name).into_iter().chain(others) {
            let mut found = self.named.iter().filter(|(n, _)| n == name);
            if let (Some(_), Some((_, second))) = (found.next(), found.next()) {
                let keyword = format!("PTYPE{}", second.index + 1);
                return Err(self.header.error(&keyword, format!("one {name} alone")));
            }
        }
        Ok(())
    }

    /// Refuses projections other than the orthographic one: (u, v) of `UU---NCP` are others.
    fn check_projection(&self) -> Result<(), FileError> {
        for (name, Parameter { index, .. }) in &self.named {
            let Some(rest) = name.strip_prefix("UU").or(name.strip_prefix("VV")) else { continue };
            if !rest.split('-').all(|part| matches!(part, "" | "L" | "SIN")) {
                let keyword = format!("PTYPE{}", index + 1);
                return Err(self
                    .header
                    .error(&keyword, "UU, UU---SIN or UU-L-SIN, and the same of VV"));
            }
        }
        Ok(())
    }

    fn missing(&self, name: &str) -> FileError {
        self.header.error("PTYPE1", format!("no random parameter is named {name}"))
    }

    fn antennas(&self) -> Result<Antennas, FileError> {
        if let Some(baseline) = self.optional("BASELINE") {
            return Ok(Antennas::Baseline(baseline));
        }
        let pair = self.optional("ANTENNA1").zip(self.optional("ANTENNA2"));
        let (first, second) = pair.ok_or_else(|| self.missing("BASELINE"))?;
        Ok(Antennas::Pair(first, second, self.optional("SUBARRAY")))
    }
}
