//! Visibilities with their errors: what an array has measured, or would.

mod average;
mod repeats;
mod scans;
mod select;

pub use average::Averaging;
pub use repeats::Repeats;
pub use select::Flags;

use super::Complex64;
use super::array::Station;
use super::earth::SourcePosition;

/// Basis of the four products of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Basis {
    /// Correlations of circular feeds: RR, LL, RL, LR.
    Circular,
    /// Stokes parameters: I, Q, U, V.
    Stokes,
}

/// A baseline at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Hours of UTC since 0 h of the observation's day.
    pub time_h: f64,
    /// Integration time in seconds; 0 where a file does not tell.
    pub integration_s: f64,
    /// Indices of the two stations.
    pub stations: [u16; 2],
    /// (position₁ − position₂)/wavelength along east and north of the source.
    pub uv: [f64; 2],
    /// The four products in Jy, in the order of [`Basis`].
    pub products: [Complex64; 4],
    /// Standard deviation in Jy of each product's real part, and of its imaginary part; NaN where
    /// there is no such product.
    pub noise_sigma: [f64; 4],
    /// Zenith opacities at the stations, dimensionless; 0 where a file does not tell.
    pub opacity: [f32; 2],
    /// Index in [`Observation::channels`]; 0 where there are none.
    pub channel: u16,
}

/// A spectral channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Channel {
    /// Frequency in Hz, of which its (u, v) count wavelengths.
    pub frequency_hz: f64,
    /// Bandwidth in Hz; 0 where a file does not tell.
    pub bandwidth_hz: f64,
}

/// A complex visibility with its error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Visibility in Jy.
    pub visibility: Complex64,
    /// Standard deviation in Jy of its real part, and of its imaginary part.
    pub noise_sigma: f64,
}

impl Measured {
    /// Returns whether it stands for a product that was not measured: exactly 0 with an error of 0,
    /// which eht-imaging writes for the cross hands of Stokes I alone.
    pub fn is_unmeasured(&self) -> bool {
        self.noise_sigma == 0.0 && self.visibility == Complex64::new(0.0, 0.0)
    }
}

impl Row {
    /// A row without any product: hours of UTC, (u, v) in wavelengths.
    pub fn empty(time_h: f64, stations: [u16; 2], uv: [f64; 2]) -> Self {
        Row {
            time_h,
            integration_s: 0.0,
            stations,
            uv,
            products: [Complex64::new(0.0, 0.0); 4],
            noise_sigma: [f64::NAN; 4],
            opacity: [0.0; 2],
            channel: 0,
        }
    }

    /// The same with Stokes I alone.
    pub fn total_intensity(time_h: f64, stations: [u16; 2], uv: [f64; 2], i: Measured) -> Self {
        let mut row = Row::empty(time_h, stations, uv);
        (row.products[0], row.noise_sigma[0]) = (i.visibility, i.noise_sigma);
        row
    }

    /// Product `k`, if there is one.
    pub fn product(&self, k: usize) -> Option<Measured> {
        let noise_sigma = self.noise_sigma[k];
        let visibility = self.products[k];
        (!noise_sigma.is_nan()).then_some(Measured { visibility, noise_sigma })
    }

    /// Product `k`, if it was measured.
    pub fn measured(&self, k: usize) -> Option<Measured> {
        self.product(k).filter(|product| !product.is_unmeasured())
    }

    /// The products that Stokes I is made of: itself, or the parallel hands that were measured.
    pub fn parts_of_i(&self, basis: Basis) -> [Option<Measured>; 2] {
        match basis {
            Basis::Stokes => [self.product(0), None],
            Basis::Circular => [self.measured(0), self.measured(1)],
        }
    }

    /// Stokes I: the mean of both parallel hands, with the error ½√(σ²(RR) + σ²(LL)). Where one hand
    /// was measured, it is that hand with its own error, which holds for a source without circular
    /// polarisation (RR = I + V, LL = I − V).
    pub fn stokes_i(&self, basis: Basis) -> Option<Measured> {
        match self.parts_of_i(basis) {
            [Some(rr), Some(ll)] => Some(Measured {
                // Halves first: their sum has the range of a double.
                visibility: 0.5 * rr.visibility + 0.5 * ll.visibility,
                noise_sigma: 0.5 * rr.noise_sigma.hypot(ll.noise_sigma),
            }),
            [one, other] => one.or(other),
        }
    }

    /// The same measurement with the stations in the other order: (u, v) is negated, visibilities
    /// are conjugated, and what was RL is LR, its error too.
    #[must_use]
    pub fn swapped(&self, basis: Basis) -> Self {
        let mut row = *self;
        row.stations.reverse();
        row.opacity.reverse();
        row.uv = row.uv.map(|x| -x);
        row.products = row.products.map(|v| v.conj());
        if basis == Basis::Circular {
            row.products.swap(2, 3);
            row.noise_sigma.swap(2, 3);
        }
        row
    }
}

/// Measurements of a source by an array. Text tables of visibilities do not hold everything: what is
/// not known is `None`.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// Name of the source.
    pub source: String,
    /// Position.
    pub position: Option<SourcePosition>,
    /// Modified Julian date whose 0 h UTC the rows' times count from.
    pub mjd: Option<i32>,
    /// Frequency in Hz that (u, v) are counted in wavelengths of, where there are no `channels`.
    pub frequency_hz: Option<f64>,
    /// Bandwidth in Hz, of all channels together.
    pub bandwidth_hz: Option<f64>,
    /// Spectral channels that rows belong to, each with (u, v) of its own frequency; none where all
    /// rows are of `frequency_hz`.
    pub channels: Vec<Channel>,
    /// Basis of the rows' products.
    pub basis: Basis,
    /// The stations that rows point to.
    pub stations: Vec<Station>,
    /// The measurements.
    pub rows: Vec<Row>,
    /// History of the data, in lines of text.
    pub history: Vec<String>,
}

/// A metadatum that an operation needs and the observation does not hold.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the data lack {0}: give it")]
pub struct MissingMetadata(pub &'static str);

impl Observation {
    /// No data of nothing.
    pub fn empty(basis: Basis) -> Self {
        Observation {
            source: String::new(),
            position: None,
            mjd: None,
            frequency_hz: None,
            bandwidth_hz: None,
            channels: Vec::new(),
            basis,
            stations: Vec::new(),
            rows: Vec::new(),
            history: Vec::new(),
        }
    }

    /// Frequency in Hz of a row.
    pub fn frequency_of(&self, row: &Row) -> Option<f64> {
        let channel = self.channels.get(usize::from(row.channel));
        channel.map_or(self.frequency_hz, |channel| Some(channel.frequency_hz))
    }

    /// Names of a row's stations, `?` where there is none of that number.
    pub fn names(&self, row: &Row) -> [&str; 2] {
        row.stations.map(|k| self.stations.get(usize::from(k)).map_or("?", |s| s.name.as_str()))
    }

    /// Lines of the history which say that the data are not calibrated, or have no errors or frequencies of their own.
    pub fn cautions(&self) -> impl Iterator<Item = &str> {
        let is_caution = |line: &&str| {
            let starts = ["no weights:", "no AIPS FQ table:"];
            line.ends_with("CAL: 0") || starts.iter().any(|start| line.starts_with(start))
        };
        self.history.iter().map(String::as_str).filter(is_caution)
    }

    /// Rows of total intensity with their Stokes I.
    pub fn stokes_i(&self) -> impl Iterator<Item = (&Row, Measured)> {
        self.rows.iter().filter_map(|row| Some((row, row.stokes_i(self.basis)?)))
    }

    /// Puts rows in order of time, then of baseline, then of channel; stations of each baseline in
    /// the array's order.
    pub fn sort(&mut self) {
        for row in &mut self.rows {
            if row.stations[0] > row.stations[1] {
                *row = row.swapped(self.basis);
            }
        }
        let place = |row: &Row| (row.stations, row.channel);
        self.rows.sort_by(|a, b| a.time_h.total_cmp(&b.time_h).then(place(a).cmp(&place(b))));
    }

    /// Returns whether more than total intensity was measured: RL and LR, or Q, U or V.
    pub fn is_polarized(&self) -> bool {
        let beside_i = match self.basis {
            Basis::Circular => 2..4,
            Basis::Stokes => 1..4,
        };
        self.rows.iter().any(|row| beside_i.clone().any(|k| row.measured(k).is_some()))
    }

    /// The data as Stokes I only, of every row that has it.
    #[must_use]
    pub fn total_intensity(&self) -> Self {
        let rows = self
            .stokes_i()
            .map(|(row, i)| Row {
                integration_s: row.integration_s,
                opacity: row.opacity,
                channel: row.channel,
                ..Row::total_intensity(row.time_h, row.stations, row.uv, i)
            })
            .collect();
        Observation { basis: Basis::Stokes, rows, ..self.clone_without_rows() }
    }

    pub(super) fn clone_without_rows(&self) -> Self {
        Observation {
            rows: Vec::new(),
            source: self.source.clone(),
            stations: self.stations.clone(),
            history: self.history.clone(),
            channels: self.channels.clone(),
            ..*self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row() -> Row {
        let c = Complex64::new;
        Row {
            products: [c(1.0, 2.0), c(3.0, -4.0), c(5.0, 6.0), c(7.0, 8.0)],
            noise_sigma: [0.1, 0.2, 0.3, 0.4],
            opacity: [0.5, 0.6],
            ..Row::empty(4.0, [0, 1], [10.0, -20.0])
        }
    }

    #[test]
    fn exact_swapping_keeps_errors_with_their_products() {
        let swapped = row().swapped(Basis::Circular);
        assert_eq!(swapped.products[2], Complex64::new(7.0, -8.0));
        assert_eq!(swapped.noise_sigma, [0.1, 0.2, 0.4, 0.3]);
        assert_eq!((swapped.uv, swapped.opacity), ([-10.0, 20.0], [0.6, 0.5]));
        assert_eq!(swapped.swapped(Basis::Circular), row());
        assert_eq!(row().swapped(Basis::Stokes).noise_sigma, row().noise_sigma);
    }

    #[test]
    fn exact_stokes_i_of_one_hand_or_both() {
        let both = row().stokes_i(Basis::Circular).unwrap();
        assert_eq!(both.visibility, Complex64::new(2.0, -1.0));
        assert!((both.noise_sigma - 0.05f64.sqrt() / 2.0).abs() < 1e-16);
        let mut one = row();
        one.noise_sigma[0] = f64::NAN;
        assert_eq!(one.stokes_i(Basis::Circular), one.product(1));
        one.noise_sigma[1] = f64::NAN;
        assert_eq!(one.stokes_i(Basis::Circular), None);
    }
}
