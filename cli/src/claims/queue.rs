//! Which piece a process takes next.

use super::{Board, Claim, Claims, Watch};
use anyhow::Context;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// After so many pieces that others had taken, all claims are read once more.
const COLLISIONS: usize = 16;

/// Pieces of a shared folder, and this process among those that work on them.
pub struct Queue {
    /// How this process tells the others what becomes of the pieces that it takes.
    pub claims: Claims,
    pieces: Vec<String>,
    folder: PathBuf,
    board: Board,
    watch: Watch,
    /// Numbers of those that are open as far as is known, the first one last.
    open: Vec<usize>,
}

impl Queue {
    /// Joins those who work on `pieces`, which are taken in this order, in a folder that is made if there is none.
    pub fn join(folder: &Path, pieces: Vec<String>) -> anyhow::Result<Self> {
        let claims = Claims::join(folder)?;
        let open = (0..pieces.len()).rev().collect();
        let (watch, board) = (Watch::new(folder), Board::default());
        let mut queue = Self { claims, pieces, folder: folder.to_owned(), board, watch, open };
        queue.look()?;
        Ok(queue)
    }

    /// How many pieces have not ended, as far as is known.
    pub fn open(&self) -> usize {
        self.open.len()
    }

    /// Reads all claims; how long that takes.
    pub fn look(&mut self) -> anyhow::Result<Duration> {
        let clock = Instant::now();
        self.board = Board::read(&self.folder)
            .with_context(|| format!("cannot read {}", self.folder.display()))?;
        let (board, pieces) = (&self.board, &self.pieces);
        self.open.retain(|at| board.of(&pieces[*at]).is_open());
        Ok(clock.elapsed())
    }

    /// From now on takes first what costs most, of the same cost in the order of the pieces.
    pub fn prefer(&mut self, cost: impl Fn(usize) -> f64) {
        self.open.sort_by(|a, b| cost(*a).total_cmp(&cost(*b)).then(b.cmp(a)));
    }

    /// Takes a piece that nobody has or, if there is none, one whose worker is dead; its number among the pieces.
    pub fn next(&mut self) -> anyhow::Result<Option<(usize, Claim)>> {
        let mut lost = 0;
        for k in (0..self.open.len()).rev() {
            let piece = &self.pieces[self.open[k]];
            if !self.board.of(piece).is_free() {
                continue;
            }
            if let Some(taken) = self.take(k)? {
                return Ok(Some(taken));
            }
            lost += 1;
            if lost == COLLISIONS {
                // Others are ahead: what they have taken is learned at once.
                self.look()?;
                return self.next();
            }
        }
        self.look()?;
        self.abandoned()
    }

    fn abandoned(&mut self) -> anyhow::Result<Option<(usize, Claim)>> {
        for k in (0..self.open.len()).rev() {
            let piece = &self.pieces[self.open[k]];
            let now = self.board.of(piece);
            if (now.is_free() || self.watch.is_abandoned(piece, now.turns - 1))
                && let Some(taken) = self.take(k)?
            {
                return Ok(Some(taken));
            }
        }
        Ok(None)
    }

    fn take(&mut self, k: usize) -> anyhow::Result<Option<(usize, Claim)>> {
        let piece = &self.pieces[self.open[k]];
        let turn = self.board.of(piece).turns;
        let claim = self.claims.take(piece, turn)?;
        // Whoever has it: it is not free.
        self.board.add(&format!("{piece}.{turn}"));
        Ok(claim.map(|claim| (self.open[k], claim)))
    }

    /// Says that a piece was done before: nobody takes it.
    pub fn skip(&mut self, at: usize) -> anyhow::Result<()> {
        self.claims.done_before(&self.pieces[at])?;
        self.forget(at);
        Ok(())
    }

    /// Whether whoever took a piece last is dead, as far as is known yet.
    pub fn is_abandoned(&mut self, at: usize) -> bool {
        let piece = &self.pieces[at];
        let now = Board::read(&self.folder).unwrap_or_default().of(piece);
        now.is_open() && (now.is_free() || self.watch.is_abandoned(piece, now.turns - 1))
    }

    /// Says that a piece is done, which took this process so long.
    pub fn done(&mut self, (at, claim): (usize, &Claim), seconds: f64) -> anyhow::Result<()> {
        self.claims.done(claim, seconds)?;
        self.forget(at);
        Ok(())
    }

    /// Says that a piece failed, and why.
    pub fn failed(&mut self, (at, claim): (usize, &Claim), why: &str) -> anyhow::Result<()> {
        self.claims.failed(claim, why)?;
        self.forget(at);
        Ok(())
    }

    fn forget(&mut self, at: usize) {
        // What was taken last is near the end.
        if let Some(k) = self.open.iter().rposition(|other| *other == at) {
            self.open.remove(k);
        }
    }
}
