//! Words on the map. This file guarantees that no two of them lie on each other: a word that finds
//! no free place beside its point is left out, so whoever matters more is placed first.

use super::canvas::{View, text, text_width};
use nalgebra::Point2;
use svg::node::element::{Group, Text};

/// Between a point and its word, px.
const GAP: f64 = 4.0;

/// The words placed so far, and what they must not cover.
#[derive(Debug)]
pub(super) struct Labels {
    page: [f64; 4],
    taken: Vec<[f64; 4]>,
    texts: Vec<Text>,
}

/// How a word looks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Look {
    pub(super) size: f64,
    pub(super) colour: &'static str,
    pub(super) bold: bool,
}

impl Labels {
    /// No words yet, all of the map free.
    pub(super) fn new(view: &View) -> Self {
        Self {
            page: view.edges(),
            taken: Vec::new(),
            texts: Vec::new(),
        }
    }

    /// Keeps words off a disc, px.
    pub(super) fn keep_off(&mut self, centre: Point2<f64>, radius: f64) {
        let (x, y) = (centre.x, centre.y);
        self.taken
            .push([x - radius, y - radius, x + radius, y + radius]);
    }

    /// Keeps words off a line, and so far to either side, px.
    pub(super) fn keep_off_line(&mut self, from: Point2<f64>, to: Point2<f64>, half: f64) {
        let pieces = ((to - from).norm() / (2.0 * half)).ceil().max(1.0) as usize;
        for piece in 0..=pieces {
            let share = piece as f64 / pieces as f64;
            self.keep_off(from + (to - from) * share, half);
        }
    }

    /// Writes `content` centred on `centre` (px) or just above or below it.
    pub(super) fn centred(&mut self, centre: Point2<f64>, content: &str, look: Look) -> bool {
        let width = text_width(content, look.size);
        let line = 1.25 * look.size;
        [0.0, 1.0, -1.0, 2.0, -2.0, 3.0, -3.0]
            .into_iter()
            .any(|lines| {
                let corner = Point2::new(centre.x - width / 2.0, centre.y + lines * line);
                self.put(corner, content, look)
            })
    }

    /// Writes `content` centred on `centre` (px), if nothing is there.
    pub(super) fn at(&mut self, centre: Point2<f64>, content: &str, look: Look) -> bool {
        let width = text_width(content, look.size);
        self.put(Point2::new(centre.x - width / 2.0, centre.y), content, look)
    }

    /// Writes `content` beside a disc of `radius` around `point` (px), on the first free side.
    pub(super) fn beside(
        &mut self,
        point: Point2<f64>,
        radius: f64,
        content: &str,
        look: Look,
    ) -> bool {
        let width = text_width(content, look.size);
        let (away, half) = (radius + GAP, 0.7 * look.size);
        let slant = 0.75 * radius + GAP / 2.0;
        [
            (away, 0.0),
            (-away - width, 0.0),
            (-width / 2.0, -away - half),
            (-width / 2.0, away + half),
            (slant, -slant - half),
            (slant, slant + half),
            (-slant - width, -slant - half),
            (-slant - width, slant + half),
        ]
        .into_iter()
        .any(|(dx, dy)| self.put(Point2::new(point.x + dx, point.y + dy), content, look))
    }

    /// Writes from `start` (px, the middle of the text's height) if nothing is there yet.
    fn put(&mut self, start: Point2<f64>, content: &str, look: Look) -> bool {
        let [x, y] = [start.x, start.y];
        let width = text_width(content, look.size);
        let half = 0.6 * look.size;
        let area = [x, y - half, x + width, y + half];
        let [left, top, right, bottom] = self.page;
        let outside = area[0] < left || area[1] < top || area[2] > right || area[3] > bottom;
        if outside || self.taken.iter().any(|other| overlap(&area, other)) {
            return false;
        }
        self.taken.push(area);
        // A pale edge keeps the word readable on whatever it lies. The middle is anchored, so that
        // another font's widths spread to both sides.
        let mut word = text(x + width / 2.0, y + 0.36 * look.size, content, look.size)
            .set("text-anchor", "middle")
            .set("fill", look.colour)
            .set("stroke", "#ffffff")
            .set("stroke-width", "3")
            .set("stroke-opacity", "0.8")
            .set("stroke-linejoin", "round")
            .set("paint-order", "stroke");
        if look.bold {
            word = word.set("font-weight", "bold");
        }
        self.texts.push(word);
        true
    }

    /// All words.
    pub(super) fn draw(self) -> Group {
        self.texts.into_iter().fold(Group::new(), Group::add)
    }
}

fn overlap(a: &[f64; 4], b: &[f64; 4]) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_never_overlap_and_stay_on_the_map() {
        let view = View::new([0.0, 0.0, 10.0, 10.0], 0.0, [0.0, 0.0], [400.0, 400.0]);
        let mut labels = Labels::new(&view);
        let look = Look {
            size: 12.0,
            colour: "#000000",
            bold: false,
        };
        let placed = (0..40)
            .filter(|_| labels.beside(Point2::new(200.0, 200.0), 5.0, "somebody", look))
            .count();
        assert!((4..=8).contains(&placed), "{placed}");
        assert!(labels.beside(Point2::new(399.0, 10.0), 2.0, "edge", look));
        labels.keep_off(Point2::new(100.0, 350.0), 40.0);
        assert!(!labels.centred(Point2::new(100.0, 350.0), "here", look));
        for (i, a) in labels.taken.iter().enumerate() {
            assert!(a[2] <= 400.0 && labels.taken[..i].iter().all(|b| !overlap(a, b)));
        }
        labels.keep_off_line(Point2::new(20.0, 50.0), Point2::new(380.0, 60.0), 5.0);
        assert!(!labels.at(Point2::new(290.0, 57.5), "on it", look));
    }
}
