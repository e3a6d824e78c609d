//! All that data of visibilities say, as the device has it.

use crate::fit::loss::objective::Objective;
use crate::fit::loss::terms::Compared;
use core::ops::Range;
use kerrlight_vlbi::data_terms::{ClosureScan, Comparison};
use kerrlight_vlbi::operator::ImageGrid;
use kerrlight_vlbi::products::ClosureKind;

/// Kind of comparison of a visibility.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Flux,
    Visibility,
    Amplitude,
    Closed,
}

/// A visibility of the model: `Seen` of the shader.
#[derive(Clone, Debug, PartialEq)]
struct Seen {
    uv: [f32; 2],
    pulse: f32,
    kind: Kind,
    datum: [f32; 2],
    weight: f32,
    /// Closure quantities that it is in, counted from the first of its frame, and its sign there.
    uses: Vec<(usize, f32)>,
}

/// Data of all terms but that of images.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Comparisons {
    /// Visibilities, 12 words each.
    pub seen: Vec<u32>,
    /// Closure quantities, 8 words each.
    pub closures: Vec<u32>,
    /// Visibilities in closure quantities, and their signs.
    pub legs: Vec<u32>,
    /// Closure quantities that visibilities are in, and their signs.
    pub uses: Vec<u32>,
    /// Rows of inverse covariances.
    pub precision: Vec<f32>,
    /// Begin and end of the visibilities and closure quantities of each frame.
    pub frames: Vec<[u32; 4]>,
    /// Grid of pixels; none if nothing but fluxes is compared.
    pub sky: Option<ImageGrid>,
}

impl Comparisons {
    /// Takes the data of a fit; none if there are such as only this processor compares.
    pub fn new(objective: &Objective<f32>) -> Option<Self> {
        let mut all = Self::default();
        for frame in 0..objective.model.frames() {
            let begin = all.counts();
            let mut visibilities = Vec::new();
            for (k, other) in objective.data.others.iter().enumerate() {
                let first = visibilities.len();
                let compared = other.term.compared(frame)?;
                visibilities.extend(all.frame(compared, k, first, begin[1] as usize)?);
                // Only now does every visibility know all closure quantities that it is in.
                for seen in &visibilities[first..] {
                    all.push(seen, k);
                }
            }
            let end = all.counts();
            all.frames.push([begin[0], end[0], begin[1], end[1]]);
        }
        Some(all)
    }

    fn counts(&self) -> [u32; 2] {
        [self.seen.len() as u32 / 12, self.closures.len() as u32 / 8]
    }

    /// The most visibilities, and the most closure quantities, of a frame.
    pub fn most(&self) -> [usize; 2] {
        let most = |ends: fn(&[u32; 4]) -> u32| self.frames.iter().map(ends).max().unwrap_or(0);
        [most(|ends| ends[1] - ends[0]) as usize, most(|ends| ends[3] - ends[2]) as usize]
    }

    /// Visibilities of a term in a frame, of which there are `first` already; its closure quantities, behind the
    /// `before` of other frames, are added.
    fn frame(
        &mut self,
        compared: Compared,
        term: usize,
        first: usize,
        before: usize,
    ) -> Option<Vec<Seen>> {
        let (sky, seen, with) = match compared {
            Compared::Nothing => return Some(Vec::new()),
            Compared::Flux(flux, weight) => {
                let seen = Seen { kind: Kind::Flux, ..Seen::at(([0.0; 2], 1.0)) };
                return Some(vec![Seen { datum: [flux, 0.0], weight, ..seen }]);
            }
            Compared::Scan { sky, seen, with } => (sky, seen, with),
        };
        // All terms share one table of places.
        if *self.sky.get_or_insert(sky) != sky {
            return None;
        }
        let mut seen: Vec<Seen> = seen.into_iter().map(Seen::at).collect();
        match with {
            Comparison::Visibilities(data) => {
                for (seen, (datum, weight)) in seen.iter_mut().zip(data) {
                    let datum = [datum.re, datum.im];
                    *seen = Seen { kind: Kind::Visibility, datum, weight, ..seen.clone() };
                }
            }
            Comparison::Amplitudes(data) => {
                for (seen, (datum, weight)) in seen.iter_mut().zip(data) {
                    let datum = [datum, 0.0];
                    *seen = Seen { kind: Kind::Amplitude, datum, weight, ..seen.clone() };
                }
            }
            Comparison::Closures { kind, scans, .. } => {
                let is_phase = kind == ClosureKind::Phase;
                for scan in &scans {
                    self.scan(scan, term, first, before, is_phase, &mut seen);
                }
            }
        }
        Some(seen)
    }

    /// Adds closure quantities.
    fn scan(
        &mut self,
        scan: &ClosureScan,
        term: usize,
        first: usize,
        before: usize,
        is_phase: bool,
        seen: &mut [Seen],
    ) {
        // Counted from the first of its frame: kernels have room for the frames of a piece alone.
        let begin = self.counts()[1] as usize - before;
        let count = scan.data.len();
        for (k, (legs, datum)) in scan.legs.iter().zip(&scan.data).enumerate() {
            let of_legs = range(&self.legs, legs.len());
            self.closures.extend([of_legs.start, of_legs.end, begin as u32, count as u32]);
            // The scan's inverse covariance is appended below, row after row.
            let row = (self.precision.len() + k * count) as u32;
            self.closures.extend([row, term as u32, datum.to_bits(), u32::from(is_phase)]);
            for (visibility, sign) in legs {
                self.legs.extend([(first + visibility) as u32, sign.to_bits()]);
                seen[*visibility].uses.push((begin + k, *sign));
            }
        }
        self.precision.extend(&scan.precision);
    }

    fn push(&mut self, seen: &Seen, term: usize) {
        let [u, v] = seen.uv.map(f32::to_bits);
        let [re, im] = seen.datum.map(f32::to_bits);
        let uses = range(&self.uses, seen.uses.len());
        self.seen.extend([u, v, seen.pulse.to_bits(), seen.kind as u32]);
        self.seen.extend([re, im, seen.weight.to_bits(), term as u32]);
        self.seen.extend([uses.start, uses.end, 0, 0]);
        let words = |(closure, sign): &(usize, f32)| [*closure as u32, sign.to_bits()];
        self.uses.extend(seen.uses.iter().flat_map(words));
    }
}

/// Returns the range of so many pairs of words behind others.
fn range(pairs: &[u32], count: usize) -> Range<u32> {
    let first = pairs.len() / 2;
    first as u32..(first + count) as u32
}

impl Seen {
    fn at((uv, pulse): ([f64; 2], f64)) -> Self {
        let (uv, pulse) = (uv.map(|u| u as f32), pulse as f32);
        Self { uv, pulse, kind: Kind::Closed, datum: [0.0; 2], weight: 0.0, uses: Vec::new() }
    }
}
