use super::*;
use crate::error::Failure;

fn ranks(rank: usize, count: usize) -> Ranks {
    Ranks { rank, count }
}

/// Whatever the numbers of items and ranks, every item has one owner, and no rank has two more than another.
#[test]
fn every_item_has_one_owner_and_ranks_own_equally_many() {
    for count in 1..9 {
        for items in 0..40 {
            let owned: Vec<Range<usize>> = (0..count).map(|rank| ranks(rank, count).own(items)).collect();
            let lengths: Vec<usize> = owned.iter().map(ExactSizeIterator::len).collect();
            assert_eq!(lengths.iter().sum::<usize>(), items);
            assert!(lengths.iter().max().unwrap() - lengths.iter().min().unwrap() <= 1, "{lengths:?}");
            for item in 0..items {
                let owner = ranks(0, count).owner(item, items);
                assert!((0..count).all(|rank| ranks(rank, count).owns(item, items) == (rank == owner)));
            }
        }
    }
}

fn told<T: Shared>(value: &T) -> T {
    let mut words = Vec::new();
    value.put(&mut words);
    let mut rest = words.as_slice();
    let taken = T::take(&mut rest);
    assert!(rest.is_empty());
    taken
}

/// Signed zeros, infinities and NaN come across with their bits, and a failure with its figures.
#[test]
fn what_is_told_keeps_its_bits() {
    let values =
        vec![[0.1, -0.0], [f64::INFINITY, f64::MIN_POSITIVE / 3.0], [f64::from_bits(0x7ff8_dead_beef_0001), 2.0]];
    let bits = |values: &[[f64; 2]]| values.as_flattened().iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    let (taken, number, yes) = told(&(values.clone(), 7_usize, true));
    assert_eq!((bits(&taken), number, yes), (bits(&values), 7, true));
    let failure = Failure::LinearStalled { unknowns: 9, residual: 0.5, tolerance: 1e-12, iterations: 40 };
    assert_eq!(told::<Result<usize, Failure>>(&Err(failure.clone())), Err(failure));
    assert_eq!(told::<Result<usize, Failure>>(&Ok(3)), Ok(3));
}

/// Three ranks cannot own two subdomains: the error says what to change, in both directions.
#[test]
fn more_ranks_than_subdomains_are_refused_with_both_remedies() {
    assert!(ranks(0, 4).check_subdomains(&[2, 2]).is_ok());
    let error = ranks(2, 3).check_subdomains(&[2, 1]).unwrap_err().to_string();
    assert!(error.contains("`subdomains` is [2, 1], but 3 ranks need one subdomain each"), "{error}");
    assert!(error.contains("give more subdomains, or start 2 of them"), "{error}");
}

/// One rank has nothing to exchange.
#[test]
fn a_single_rank_receives_nothing() {
    let here = Ranks::here();
    let mut items = [1, 2, 3];
    let doubled = here.map_mut(&mut items, |item| {
        *item *= 2;
        *item as usize
    });
    assert_eq!((doubled, items), (vec![2, 4, 6], [2, 4, 6]));
    assert_eq!(here.map(&[5, 6], |_| 0, |item| *item as f64), [5.0, 6.0]);
    assert!(!here.any(false) && here.any(true));
    assert_eq!(here.from_first(|| Ok(b"study".to_vec())), Ok(b"study".to_vec()));
    assert_eq!(here.from_first(|| Err("it is not there".into())), Err("it is not there".into()));
    assert_eq!((here.count(), here.traffic()), (1, Traffic::default()));
}
