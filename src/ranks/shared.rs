//! What ranks tell each other, as words of 64 bits.

use crate::error::Failure;

/// A value that can be told to another rank, to the last bit.
pub(crate) trait Shared: Sized {
    /// Adds its words.
    fn put(&self, words: &mut Vec<u64>);

    /// Takes it from the front of the words.
    fn take(words: &mut &[u64]) -> Self;
}

impl Shared for u64 {
    fn put(&self, words: &mut Vec<u64>) {
        words.push(*self);
    }

    fn take(words: &mut &[u64]) -> Self {
        let (word, rest) = words.split_first().expect("all ranks share values of the same types");
        *words = rest;
        *word
    }
}

impl Shared for usize {
    fn put(&self, words: &mut Vec<u64>) {
        words.push(*self as u64);
    }

    fn take(words: &mut &[u64]) -> Self {
        u64::take(words) as usize
    }
}

impl Shared for bool {
    fn put(&self, words: &mut Vec<u64>) {
        words.push(u64::from(*self));
    }

    fn take(words: &mut &[u64]) -> Self {
        u64::take(words) == 1
    }
}

impl Shared for f64 {
    fn put(&self, words: &mut Vec<u64>) {
        words.push(self.to_bits());
    }

    fn take(words: &mut &[u64]) -> Self {
        Self::from_bits(u64::take(words))
    }
}

impl<T: Shared, const N: usize> Shared for [T; N] {
    fn put(&self, words: &mut Vec<u64>) {
        self.iter().for_each(|value| value.put(words));
    }

    fn take(words: &mut &[u64]) -> Self {
        std::array::from_fn(|_| T::take(words))
    }
}

impl<T: Shared> Shared for Vec<T> {
    fn put(&self, words: &mut Vec<u64>) {
        self.len().put(words);
        self.iter().for_each(|value| value.put(words));
    }

    fn take(words: &mut &[u64]) -> Self {
        (0..usize::take(words)).map(|_| T::take(words)).collect()
    }
}

impl<A: Shared, B: Shared> Shared for (A, B) {
    fn put(&self, words: &mut Vec<u64>) {
        self.0.put(words);
        self.1.put(words);
    }

    fn take(words: &mut &[u64]) -> Self {
        (A::take(words), B::take(words))
    }
}

impl<A: Shared, B: Shared, C: Shared> Shared for (A, B, C) {
    fn put(&self, words: &mut Vec<u64>) {
        self.0.put(words);
        self.1.put(words);
        self.2.put(words);
    }

    fn take(words: &mut &[u64]) -> Self {
        (A::take(words), B::take(words), C::take(words))
    }
}

/// What a subdomain found, or why it was not solved.
impl<T: Shared> Shared for Result<T, Failure> {
    fn put(&self, words: &mut Vec<u64>) {
        self.is_ok().put(words);
        match self {
            Ok(value) => value.put(words),
            Err(Failure::LinearStalled { unknowns, residual, tolerance, iterations }) => {
                ([*unknowns, *iterations], [*residual, *tolerance]).put(words);
            }
            Err(other) => unreachable!("a linear system fails as linear-stalled, not as {}", other.name()),
        }
    }

    fn take(words: &mut &[u64]) -> Self {
        if bool::take(words) {
            return Ok(T::take(words));
        }
        let ([unknowns, iterations], [residual, tolerance]) = Shared::take(words);
        Err(Failure::LinearStalled { unknowns, residual, tolerance, iterations })
    }
}
