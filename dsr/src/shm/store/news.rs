//! When those who sleep are woken for what the store did. It guarantees that who waits for an answer is woken
//! after it, and who follows commits no more than so many looks for requests later; it knows neither
//! bell nor clock.

/// How many looks for requests go by before those who follow are woken: waking takes longer than a commit, and
/// one wakes for several.
const LOOKS: u32 = 64;

/// Who has to hear of something.
#[derive(Debug, Default)]
pub(super) struct News {
    /// Somebody who may sleep waits for an answer that was given.
    answered: bool,
    /// In how many looks those who follow have to hear of commits; 0 where there are none.
    looks: u32,
}

impl News {
    /// Notes an answer that somebody may sleep for.
    pub(super) fn answered(&mut self) {
        self.answered = true;
    }

    /// Notes commits that somebody follows.
    pub(super) fn committed(&mut self) {
        if self.looks == 0 {
            self.looks = LOOKS;
        }
    }

    /// Whether to wake everybody, after another look for requests.
    pub(super) fn is_due_after_look(&mut self) -> bool {
        let before = self.looks;
        self.looks = before.saturating_sub(1);
        let due = self.answered || before == 1;
        if due {
            *self = Self::default();
        }
        due
    }

    /// Whether to wake everybody, when no look follows for a while.
    pub(super) fn is_due_at_last(&mut self) -> bool {
        let Self { answered, looks } = std::mem::take(self);
        answered || looks > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_wakes_at_once_and_a_commit_once_for_all_that_follow_it() {
        let mut news = News::default();
        assert!(!news.is_due_after_look());
        news.answered();
        assert!(news.is_due_after_look());
        assert!(!news.is_due_after_look());
        let due: Vec<bool> = (0..2 * LOOKS)
            .map(|look| {
                if look < LOOKS {
                    news.committed();
                }
                news.is_due_after_look()
            })
            .collect();
        let at: Vec<usize> = (0..due.len()).filter(|&look| due[look]).collect();
        assert_eq!(at, [LOOKS as usize - 1]);
    }

    #[test]
    fn an_answer_wakes_also_for_commits_before_it_and_so_does_the_last_look() {
        let mut news = News::default();
        news.committed();
        news.answered();
        assert!(news.is_due_after_look());
        assert!(!news.is_due_at_last());
        news.committed();
        assert!(news.is_due_at_last());
        assert!(!news.is_due_at_last());
    }
}
