//! Check that all ranks make the same film, before the first frame.

use crate::error::{Error, Result};
use crate::state::{decode_bytes, encode};
use ranks::Ranks;
use serde::{Deserialize, Serialize};

/// Answer of a rank: the film that it can make.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Present {
    /// The rank is ready for the film with this checksum: see [`FilmJob::sum`](crate::checkpoint::FilmJob::sum).
    Ready(u32),
    /// The rank has no film to make.
    Idle,
    /// The rank cannot make the film, for this reason.
    Fails(String),
}

/// Compares the answers of all ranks. Returns true if all are ready for the same film, and false if rank 0 makes none.
/// All ranks return the same result.
///
/// # Errors
/// If a rank fails, or if a rank is ready for another film than rank 0.
pub fn muster(ranks: &dyn Ranks, own: &Present) -> Result<bool> {
    if ranks.count() == 1 {
        return Ok(matches!(own, Present::Ready(_)));
    }

    // Exchange all answers, so that every rank reaches the same decision.
    let mut answers = Vec::new();
    for bytes in ranks.all_gather(encode(own)) {
        answers.push(decode_bytes::<Present>(&bytes).map_err(|_| Error::Ranks("ranks run different programs".into()))?);
    }

    // Ignore the other answers if rank 0 makes no film: it reports the reason.
    let first = &answers[0];
    if !matches!(first, Present::Ready(_)) {
        return Ok(false);
    }
    // Report the first rank that fails, or that would make another film.
    for (rank, answer) in answers.iter().enumerate() {
        match answer {
            Present::Fails(reason) => return Err(Error::Ranks(format!("rank {rank}: {reason}"))),
            answer if answer != first => {
                let text = "has another scene, other settings or another version of the program than rank 0";
                return Err(Error::Ranks(format!("rank {rank} {text}: start all ranks alike")));
            }
            _ => {}
        }
    }
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ranks::ThreadRanks;

    /// Returns the result that each rank derives from the answers of all ranks.
    fn results(answers: &[Present]) -> Vec<Result<bool, String>> {
        std::thread::scope(|scope| {
            let ranks = ThreadRanks::new(answers.len());
            let started: Vec<_> = ranks
                .into_iter()
                .zip(answers)
                .map(|(ranks, answer)| scope.spawn(move || muster(&ranks, answer).map_err(|error| error.to_string())))
                .collect();
            started.into_iter().map(|thread| thread.join().expect("no rank panics")).collect()
        })
    }

    #[test]
    fn ranks_are_ready_for_one_film_or_none_begins() {
        use Present::{Fails, Idle, Ready};
        assert_eq!(results(&[Ready(7), Ready(7), Ready(7)]), vec![Ok(true); 3]);
        for first in [Idle, Fails("no scene".into())] {
            assert_eq!(results(&[first, Ready(7), Fails("disk".into())]), vec![Ok(false); 3]);
        }
        for (second, words) in [(Ready(8), "rank 1 has another scene"), (Fails("no a.glb".into()), "rank 1: no a.glb")]
        {
            for result in results(&[Ready(7), second.clone(), Ready(7)]) {
                assert!(result.is_err_and(|error| error.starts_with(words)), "{second:?}");
            }
        }
        assert_eq!(results(&[Ready(1)]), [Ok(true)]);
        assert_eq!(results(&[Idle]), [Ok(false)]);
    }
}
