//! Names with numbers, in the order in which they came.

use rustc_hash::FxHashMap;

/// Names, each with a number.
#[derive(Debug, Clone, Default)]
pub(super) struct Names {
    list: Vec<String>,
    index: FxHashMap<String, usize>,
}

impl Names {
    /// The number of a new name, or `None` where it is known already.
    pub(super) fn add(&mut self, name: &str) -> Option<usize> {
        if self.index.contains_key(name) {
            return None;
        }
        self.list.push(name.to_owned());
        self.index.insert(name.to_owned(), self.list.len() - 1);
        Some(self.list.len() - 1)
    }

    pub(super) fn find(&self, name: &str) -> Option<usize> {
        self.index.get(name).copied()
    }

    pub(super) fn name(&self, number: usize) -> &str {
        &self.list[number]
    }

    pub(super) fn len(&self) -> usize {
        self.list.len()
    }

    /// The known name that is most like this one, if any is.
    pub(super) fn nearest(&self, name: &str) -> Option<String> {
        nearest(self.list.iter().map(String::as_str), name)
    }
}

/// The candidate that is most like a name, if any is.
pub(super) fn nearest<'a>(candidates: impl Iterator<Item = &'a str>, name: &str) -> Option<String> {
    let scored = candidates.map(|other| (strsim::damerau_levenshtein(other, name), other));
    let (distance, best) = scored.min()?;
    (distance <= 1 + name.len() / 4 && distance < name.len()).then(|| best.to_owned())
}
