//! Statistics of the residuals of one kind of data.

use kerrlight_vlbi::data_terms::Residual;
use std::collections::{BTreeMap, HashMap};

/// Sums over some residuals.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Part {
    /// Real data, less what gains that are solved for use up of them: the χ² that a right model has.
    pub freedom: f64,
    /// χ².
    pub chi2: f64,
}

impl Part {
    fn add(&mut self, value: f64, freedom: f64) {
        self.freedom += freedom;
        self.chi2 += value * value;
    }

    /// Returns the number of data that are left, to the nearest whole one.
    pub fn count(&self) -> usize {
        self.freedom.round() as usize
    }

    /// χ² per datum; none without data.
    pub fn per_datum(&self) -> Option<f64> {
        (self.count() > 0).then(|| self.chi2 / self.freedom)
    }
}

/// The residuals of one pixel in all frames.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelSum {
    /// Their number and squares.
    pub part: Part,
    /// Their sum, in σ.
    pub sum: f64,
}

/// Sums over pairs of residuals that are neighbours.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pairs {
    /// Number of pairs, each counted as the freedom of its later residual.
    freedom: f64,
    product: f64,
    squares: [f64; 2],
}

impl Pairs {
    fn add(&mut self, a: f64, b: f64, freedom: f64) {
        self.freedom += freedom;
        self.product += a * b;
        self.squares[0] += a * a;
        self.squares[1] += b * b;
    }

    /// Returns the number of pairs, to the nearest whole one.
    pub fn count(&self) -> usize {
        self.freedom.round() as usize
    }

    /// Correlation Σ ab/√(Σ a² Σ b²), dimensionless; none where one of the sums is 0.
    pub fn correlation(&self) -> Option<f64> {
        let scale = (self.squares[0] * self.squares[1]).sqrt();
        (scale > 0.0).then(|| self.product / scale)
    }
}

/// Residuals of one kind of data, added up frame by frame.
#[derive(Clone, Debug, Default)]
pub struct Statistics {
    /// All of them.
    pub all: Part,
    /// Residuals by frame; without data where nothing was observed.
    pub frames: Vec<Part>,
    /// Residuals by pixel, or by number where data of a frame have no stations.
    pub pixels: Vec<PixelSum>,
    /// Residuals by the stations of a baseline, triangle or quadrangle.
    pub groups: BTreeMap<Vec<u16>, Part>,
    /// Residuals by station, each in all groups that it is part of.
    pub stations: BTreeMap<u16, Part>,
    /// The same datum in consecutive frames.
    pub in_time: Pairs,
    /// Neighbouring pixels of a row.
    pub in_space: Pairs,
    /// Part of the data that parameters of a fit have used up, at most; 0 where nobody knows.
    pub taken: f64,
    sum: f64,
    signal: f64,
    before: Frame,
}

/// Residuals of a frame: those of stations by quantity, all others in their order.
#[derive(Clone, Debug, Default)]
struct Frame {
    plain: Vec<f64>,
    named: HashMap<(Vec<u16>, usize), f64>,
}

impl Statistics {
    /// Takes the residuals of all frames, one after the other; images have rows of `width` pixels.
    pub fn of(frames: impl IntoIterator<Item = Vec<Residual>>, width: usize) -> Self {
        let mut all = Self::default();
        frames.into_iter().for_each(|frame| all.add(frame, width));
        all.ended()
    }

    /// Ends when all frames were added.
    #[must_use]
    pub fn ended(self) -> Self {
        Self { before: Frame::default(), ..self }
    }

    /// Adds the next frame; images have rows of `width` pixels.
    pub fn add(&mut self, residuals: Vec<Residual>, width: usize) {
        let mut frame = Part::default();
        let mut now = Frame::default();
        let mut seen: HashMap<Vec<u16>, usize> = HashMap::new();
        for Residual { value, datum, freedom, stations } in residuals {
            frame.add(value, freedom);
            self.all.add(value, freedom);
            self.sum += value;
            self.signal += datum * datum;
            if stations.is_empty() {
                self.add_plain(value, &mut now, width);
                continue;
            }
            stations.iter().for_each(|k| self.stations.entry(*k).or_default().add(value, freedom));
            self.groups.entry(stations.clone()).or_default().add(value, freedom);
            // Stations may have several data in a frame, such as real and imaginary part: their
            // order tells which of them is the same quantity in the next frame.
            let repeat = seen.entry(stations.clone()).or_default();
            let key = (stations, *repeat);
            *repeat += 1;
            if let Some(before) = self.before.named.get(&key) {
                self.in_time.add(*before, value, freedom);
            }
            now.named.insert(key, value);
        }
        self.frames.push(frame);
        self.before = now;
    }

    fn add_plain(&mut self, value: f64, now: &mut Frame, width: usize) {
        let at = now.plain.len();
        if self.pixels.len() == at {
            self.pixels.push(PixelSum::default());
        }
        self.pixels[at].part.add(value, 1.0);
        self.pixels[at].sum += value;
        if let Some(before) = self.before.plain.get(at) {
            self.in_time.add(*before, value, 1.0);
        }
        // The first pixel of a row has no neighbour before it.
        if !at.is_multiple_of(width.max(1)) {
            self.in_space.add(now.plain[at - 1], value, 1.0);
        }
        now.plain.push(value);
    }

    /// χ² per datum; none without data.
    pub fn chi2(&self) -> Option<f64> {
        self.all.per_datum()
    }

    /// Mean residual, in σ; none without data.
    pub fn mean(&self) -> Option<f64> {
        (self.all.count() > 0).then(|| self.sum / self.all.freedom)
    }

    /// Root mean square of the residuals over that of the data; none for data without a natural zero.
    pub fn misfit(&self) -> Option<f64> {
        (self.signal > 0.0).then(|| (self.all.chi2 / self.signal).sqrt())
    }
}
