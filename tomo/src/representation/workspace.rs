//! Memory that is kept from one batch to the next.

use core::any::Any;

/// Memory of a representation: grows at the first batch of its size and is kept.
///
/// Scratch space. Its content carries no information from one call to the next, but from
/// [`eval_recorded`](super::Representation::eval_recorded) to the call that follows; any workspace serves any
/// representation.
#[derive(Default)]
pub struct Workspace {
    held: Option<Box<dyn Any + Send>>,
}

impl Workspace {
    /// An empty one.
    pub fn new() -> Self {
        Self::default()
    }

    /// Returns the memory of a representation; made anew when another kind has used the workspace.
    pub fn of<W: Any + Default + Send>(&mut self) -> &mut W {
        if !self.held.as_ref().is_some_and(|held| held.is::<W>()) {
            self.held = Some(Box::new(W::default()));
        }
        let held = self.held.as_mut().and_then(|held| held.downcast_mut());
        held.unwrap_or_else(|| unreachable!("put there a line above"))
    }
}

/// Numbers that start on a cache line.
#[derive(Clone, Debug, Default)]
pub struct Lines<T> {
    numbers: Vec<T>,
    start: usize,
    length: usize,
}

impl<T: Copy + Default> Lines<T> {
    /// Makes room for at least `length` numbers; old ones are lost where that takes new memory.
    pub fn resize(&mut self, length: usize) {
        self.length = length;
        if self.numbers.len() < length + LINE {
            self.numbers = vec![T::default(); length + LINE];
            // `align_offset` may answer usize::MAX; unaligned numbers are slower, not wrong.
            self.start = self.numbers.as_ptr().align_offset(LINE).min(LINE);
        }
    }

    /// The numbers.
    pub fn all(&mut self) -> &mut [T] {
        &mut self.numbers[self.start..self.start + self.length]
    }

    /// The numbers, to read.
    pub fn read(&self) -> &[T] {
        &self.numbers[self.start..self.start + self.length]
    }
}

/// Bytes of a cache line, more than numbers in one.
const LINE: usize = 64;
