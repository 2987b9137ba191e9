//! Ranks: the processes of one run, which MPI starts side by side.
//!
//! Every rank holds the whole state and takes the same steps. What is divided among ranks is work on whole subdomains:
//! each rank does the items that it owns, and then all results are given to all. No result depends on who computed it,
//! so that every number of ranks has the bits of one.
//!
//! A library without the feature `mpi`, and a program that was not started by `mpirun`, is one rank, which has nothing
//! to exchange. Only the thread that called [`begin`] may exchange anything.

#[cfg(feature = "mpi")]
mod mpi;
#[cfg(feature = "mpi")]
use self::mpi as engine;
#[cfg(not(feature = "mpi"))]
mod single;
#[cfg(not(feature = "mpi"))]
use self::single as engine;
mod shared;

pub(crate) use shared::Shared;

use crate::error::{Error, Result};
use crate::parallel;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::ops::Range;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// This rank among all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ranks {
    rank: usize,
    count: usize,
}

/// What a rank received from the others so far.
///
/// An exchange brings two messages from every other rank, the length of its part and the part; a rank that only says
/// yes or no brings one.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Messages from other ranks.
    pub messages: u64,
    /// Bytes in them.
    pub bytes: u64,
}

/// Set by [`begin`].
static HERE: OnceLock<Ranks> = OnceLock::new();
static MESSAGES: AtomicU64 = AtomicU64::new(0);
static BYTES: AtomicU64 = AtomicU64::new(0);

/// Bit of a word that a rank sends in place of a length when it has come to its end and exchanges nothing more; the
/// other bits are its exit status.
const ENDED: u64 = 1 << 63;
/// How long a rank waits to be ended by one that failed, before it ends all itself.
const PATIENCE: Duration = Duration::from_secs(20);
/// Bytes of a word.
const WORD: usize = 8;

/// The time in which a process is a rank. Where it ends by a panic, all ranks end.
#[must_use]
pub struct Membership {
    engine: Option<engine::Engine>,
}

/// Joins the ranks with which this process was started.
///
/// # Errors
/// [`Error::SeparateProcesses`] where several processes were started, but the program was built without the feature
/// `mpi`; [`Error::UnlikeRanks`] where ranks are of different versions.
pub fn begin() -> Result<Membership> {
    let (engine, rank, count) = engine::begin()?;
    let ranks = *HERE.get_or_init(|| Ranks { rank, count });
    let membership = Membership { engine: Some(engine) };
    ranks.agree("version of driftmesh", env!("CARGO_PKG_VERSION"))?;
    Ok(membership)
}

impl Membership {
    /// Leaves the ranks with an exit status. Where others go on although this rank has failed, it says why by `tell`,
    /// and ends all.
    pub fn end(mut self, status: u8, tell: impl FnOnce()) {
        let ranks = Ranks::here();
        let others = ranks.lengths(ENDED | u64::from(status));
        if others.iter().any(|word| word & ENDED == 0) {
            match status {
                0 => eprintln!("error: rank {} is done and others are not: their numbers differ", ranks.rank),
                _ => tell(),
            }
            engine::abort(i32::from(status.max(1)));
        }
        self.engine.take();
    }
}

impl Drop for Membership {
    fn drop(&mut self) {
        if self.engine.is_some() && Ranks::here().count > 1 && std::thread::panicking() {
            eprintln!("error: rank {} failed, and with it the run", Ranks::here().rank);
            engine::abort(101);
        }
    }
}

impl Ranks {
    /// This process: one of those that [`begin`] joined, or the only one.
    pub fn here() -> Self {
        HERE.get().copied().unwrap_or(Self { rank: 0, count: 1 })
    }

    /// The number of this rank, from 0.
    pub fn rank(self) -> usize {
        self.rank
    }

    /// How many there are.
    pub fn count(self) -> usize {
        self.count
    }

    /// Whether this is rank 0, which alone writes files and speaks to the user.
    pub fn is_first(self) -> bool {
        self.rank == 0
    }

    /// What this rank received so far.
    pub fn traffic(self) -> Traffic {
        Traffic { messages: MESSAGES.load(Ordering::Relaxed), bytes: BYTES.load(Ordering::Relaxed) }
    }

    /// Whether any rank says so. All have to ask.
    pub fn any(self, says: bool) -> bool {
        match self.count {
            1 => says,
            _ => self.lengths(u64::from(says)).into_iter().any(|word| word == 1),
        }
    }

    /// The bytes that rank 0 makes, or why it cannot, on all ranks. All have to ask.
    ///
    /// # Errors
    /// What `make` returned on rank 0.
    pub fn from_first(self, make: impl FnOnce() -> Result<Vec<u8>, String>) -> Result<Vec<u8>, String> {
        if self.count == 1 {
            return make();
        }
        let mut words = Vec::new();
        if self.is_first() {
            let made = make();
            made.is_ok().put(&mut words);
            let bytes = made.unwrap_or_else(String::into_bytes);
            bytes.len().put(&mut words);
            words.extend(bytes.chunks(WORD).map(|bytes| {
                let mut word = [0; WORD];
                word[..bytes.len()].copy_from_slice(bytes);
                u64::from_le_bytes(word)
            }));
        }
        let told = self.exchange(&words);
        let mut words = told[0].as_slice();
        let (made, length) = <(bool, usize)>::take(&mut words);
        let mut bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        bytes.truncate(length);
        if made { Ok(bytes) } else { Err(String::from_utf8_lossy(&bytes).into_owned()) }
    }

    /// Refuses ranks of which one has another text than rank 0; `what` names it.
    ///
    /// # Errors
    /// [`Error::UnlikeRanks`], on all ranks.
    pub fn agree(self, what: &'static str, text: &str) -> Result<()> {
        if self.count == 1 {
            return Ok(());
        }
        let mut hasher = DefaultHasher::new();
        text.hash(&mut hasher);
        let told = self.lengths(hasher.finish() & !ENDED);
        match told.iter().position(|word| *word != told[0]) {
            Some(rank) => Err(Error::UnlikeRanks { rank, what }),
            None => Ok(()),
        }
    }

    /// Refuses more ranks than there are subdomains to own.
    ///
    /// # Errors
    /// [`Error::Invalid`] for `subdomains`.
    pub(crate) fn check_subdomains(self, subdomains: &[usize]) -> Result<()> {
        let (number, ranks) = (subdomains.iter().fold(1_usize, |n, s| n.saturating_mul(*s)), self.count);
        if number >= ranks {
            return Ok(());
        }
        let rule = format!("{ranks} ranks need one subdomain each; give more subdomains, or start {number} of them");
        Err(Error::invalid("subdomains", format!("{subdomains:?}"), rule))
    }

    /// Whether this rank owns the item of a number among so many.
    pub(crate) fn owns(self, item: usize, items: usize) -> bool {
        self.own(items).contains(&item)
    }

    /// The items that this rank owns: as many neighbours as every other, give or take one.
    fn own(self, items: usize) -> Range<usize> {
        self.rank * items / self.count..(self.rank + 1) * items / self.count
    }

    /// The rank that owns the item of a number among so many.
    pub(crate) fn owner(self, item: usize, items: usize) -> usize {
        ((item + 1) * self.count - 1) / items
    }

    /// `f` of every item, in order, for items that `f` changes: each rank does those that it owns, by threads in
    /// parallel, and gets the results of the others in one exchange. Items of other ranks stay as they are.
    pub(crate) fn map_mut<T: Send, R: Shared + Send>(
        self,
        items: &mut [T],
        f: impl Fn(&mut T) -> R + Sync + Send,
    ) -> Vec<R> {
        let all = items.len();
        let mine = parallel::map_mut(&mut items[self.own(all)], f);
        self.gather(mine, (0..all).map(|item| self.owner(item, all)))
    }

    /// `f` of every item, in order: each rank does those that it owns by `owner`, by threads in parallel, and gets the
    /// results of the others in one exchange.
    pub(crate) fn map<T: Sync, R: Shared + Send>(
        self,
        items: &[T],
        owner: impl Fn(usize) -> usize,
        f: impl Fn(&T) -> R + Sync + Send,
    ) -> Vec<R> {
        let owners: Vec<usize> = (0..items.len()).map(owner).collect();
        let own: Vec<&T> =
            items.iter().zip(&owners).filter(|(_, owner)| **owner == self.rank).map(|(t, _)| t).collect();
        let mine = parallel::map(&own, |item| f(item));
        self.gather(mine, owners.into_iter())
    }

    /// The results of all ranks in the order of `owners`, of which this rank has made its own.
    fn gather<R: Shared>(self, mine: Vec<R>, owners: impl Iterator<Item = usize>) -> Vec<R> {
        if self.count == 1 {
            return mine;
        }
        let mut words = Vec::new();
        mine.iter().for_each(|result| result.put(&mut words));
        let told = self.exchange(&words);
        let mut told: Vec<&[u64]> = told.iter().map(Vec::as_slice).collect();
        let mut mine = mine.into_iter();
        let one = |rank: usize| match rank == self.rank {
            true => mine.next().expect("a rank makes all that it owns"),
            false => R::take(&mut told[rank]),
        };
        owners.map(one).collect()
    }

    /// Words of every rank.
    fn exchange(self, words: &[u64]) -> Vec<Vec<u64>> {
        let lengths = self.lengths(words.len() as u64);
        let all = engine::gather(words, &lengths);
        let others = all.len() - words.len();
        self.count_traffic(others);
        let mut rest = all.as_slice();
        let mut split = |length: &u64| {
            let (one, behind) = rest.split_at(*length as usize);
            rest = behind;
            one.to_vec()
        };
        lengths.iter().map(&mut split).collect()
    }

    /// One word of every rank. Where another rank has come to its end and this one has not, it waits there: whoever
    /// failed tells why, and ends all.
    fn lengths(self, word: u64) -> Vec<u64> {
        let told = engine::gather(&[word], &vec![1; self.count]);
        self.count_traffic(self.count - 1);
        if word & ENDED == 0 && told.iter().any(|word| word & ENDED != 0) {
            std::thread::sleep(PATIENCE);
            engine::abort(1);
        }
        told
    }

    /// Counts a message from every other rank, with so many words in all.
    fn count_traffic(self, words: usize) {
        MESSAGES.fetch_add(self.count as u64 - 1, Ordering::Relaxed);
        BYTES.fetch_add((words * WORD) as u64, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests;
