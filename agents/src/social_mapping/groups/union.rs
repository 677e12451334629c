//! Sets that only grow together, and their members in order.

/// People by index, each in one set.
#[derive(Debug, Clone)]
pub(super) struct Union {
    parents: Vec<usize>,
    /// Of each set, at its root.
    sizes: Vec<usize>,
}

impl Union {
    /// Everybody alone.
    pub(super) fn new(count: usize) -> Self {
        Self {
            parents: (0..count).collect(),
            sizes: vec![1; count],
        }
    }

    fn root(&mut self, mut index: usize) -> usize {
        while self.parents[index] != index {
            self.parents[index] = self.parents[self.parents[index]];
            index = self.parents[index];
        }
        index
    }

    /// Makes one set of both.
    pub(super) fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        if a == b {
            return;
        }
        // The smaller index leads, so that the outcome does not depend on the order of joining.
        self.parents[a.max(b)] = a.min(b);
        self.sizes[a.min(b)] += self.sizes[a.max(b)];
    }

    /// Whether somebody else is in the set of `index`.
    pub(super) fn is_joined(&mut self, index: usize) -> bool {
        let root = self.root(index);
        self.sizes[root] > 1
    }

    /// The sets of at least two, each in order, in the order of their first members.
    pub(super) fn groups(mut self) -> Vec<Vec<usize>> {
        let mut sets = vec![Vec::new(); self.parents.len()];
        for index in 0..self.parents.len() {
            let root = self.root(index);
            sets[root].push(index);
        }
        sets.retain(|set| set.len() > 1);
        sets
    }
}
