//! Words on the map. This file guarantees that no two of them lie on each other: a word that finds
//! no free place beside its point is left out, so whoever matters more is placed first. A word lies on a wall only where
//! there is no other place for it.

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
    /// What they cover only where they must.
    shunned: Vec<[f64; 4]>,
    texts: Vec<Text>,
}

/// Half the width of what is kept free of words along a wall, px.
pub(super) const WALL: f64 = 4.0;

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
            shunned: Vec::new(),
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
        self.taken.extend(along(from, to, half));
    }

    /// Keeps words off a line, and so far to either side, px, as long as there is another place for them.
    pub(super) fn shun_line(&mut self, from: Point2<f64>, to: Point2<f64>, half: f64) {
        self.shunned.extend(along(from, to, half));
    }

    /// Writes `content` centred on `centre` (px) or just above or below it.
    pub(super) fn centred(&mut self, centre: Point2<f64>, content: &str, look: Look) -> bool {
        let starts = on(centre, content, look);
        self.put_first(&starts, content, look)
    }

    /// Writes `content` on a thing: a disc of `radius` around `centre` (px), or in the middle of its space, or beside it.
    pub(super) fn on_thing(
        &mut self,
        (centre, radius): (Point2<f64>, f64),
        middle: Point2<f64>,
        content: &str,
        look: Look,
    ) -> bool {
        let mut starts = on(centre, content, look);
        starts.extend(on(middle, content, look));
        starts.extend(around(centre, radius, content, look));
        self.put_first(&starts, content, look)
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
        self.put_first(&around(point, radius, content, look), content, look)
    }

    /// Writes from the first of these places that is free and on no wall, else from the first that is free.
    fn put_first(&mut self, starts: &[Point2<f64>], content: &str, look: Look) -> bool {
        let shunned = std::mem::take(&mut self.shunned);
        let clear = |start: &&Point2<f64>| {
            let area = area(**start, content, look);
            !shunned.iter().any(|other| overlap(&area, other))
        };
        let written = starts
            .iter()
            .filter(clear)
            .chain(starts)
            .any(|start| self.put(*start, content, look));
        self.shunned = shunned;
        written
    }

    /// Writes from `start` (px, the middle of the text's height) if nothing is there yet.
    fn put(&mut self, start: Point2<f64>, content: &str, look: Look) -> bool {
        let [x, y] = [start.x, start.y];
        let width = text_width(content, look.size);
        let area = area(start, content, look);
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

/// What a word from `start` covers.
fn area(start: Point2<f64>, content: &str, look: Look) -> [f64; 4] {
    let (width, half) = (text_width(content, look.size), 0.6 * look.size);
    [start.x, start.y - half, start.x + width, start.y + half]
}

/// Squares along a line that cover it, and so far to either side.
fn along(from: Point2<f64>, to: Point2<f64>, half: f64) -> impl Iterator<Item = [f64; 4]> {
    let pieces = ((to - from).norm() / (2.0 * half)).ceil().max(1.0) as usize;
    (0..=pieces).map(move |piece| {
        let Point2 { coords } = from + (to - from) * (piece as f64 / pieces as f64);
        [
            coords.x - half,
            coords.y - half,
            coords.x + half,
            coords.y + half,
        ]
    })
}

/// From where a word is centred on a place, or just above or below it.
fn on(centre: Point2<f64>, content: &str, look: Look) -> Vec<Point2<f64>> {
    let (width, line) = (text_width(content, look.size), 1.25 * look.size);
    [0.0, 1.0, -1.0, 2.0, -2.0, 3.0, -3.0]
        .map(|lines| Point2::new(centre.x - width / 2.0, centre.y + lines * line))
        .to_vec()
}

/// From where a word lies beside a disc.
fn around(point: Point2<f64>, radius: f64, content: &str, look: Look) -> Vec<Point2<f64>> {
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
    .map(|(dx, dy)| Point2::new(point.x + dx, point.y + dy))
    .to_vec()
}

fn overlap(a: &[f64; 4], b: &[f64; 4]) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOOK: Look = Look {
        size: 12.0,
        colour: "#000000",
        bold: false,
    };

    #[test]
    fn words_never_overlap_and_stay_on_the_map() {
        let view = View::new([0.0, 0.0, 10.0, 10.0], 0.0, [0.0, 0.0], [400.0, 400.0]);
        let mut labels = Labels::new(&view);
        let placed = (0..40)
            .filter(|_| labels.beside(Point2::new(200.0, 200.0), 5.0, "somebody", LOOK))
            .count();
        assert!((4..=8).contains(&placed), "{placed}");
        assert!(labels.beside(Point2::new(399.0, 10.0), 2.0, "edge", LOOK));
        labels.keep_off(Point2::new(100.0, 350.0), 40.0);
        assert!(!labels.centred(Point2::new(100.0, 350.0), "here", LOOK));
        for (i, a) in labels.taken.iter().enumerate() {
            assert!(a[2] <= 400.0 && labels.taken[..i].iter().all(|b| !overlap(a, b)));
        }
        labels.keep_off_line(Point2::new(20.0, 50.0), Point2::new(380.0, 60.0), 5.0);
        assert!(!labels.at(Point2::new(290.0, 57.5), "on it", LOOK));
    }

    #[test]
    fn words_lie_on_a_wall_only_where_they_must() {
        let view = View::new([0.0, 0.0, 10.0, 10.0], 0.0, [0.0, 0.0], [400.0, 400.0]);
        let mut labels = Labels::new(&view);
        let wall = 200.0;
        labels.shun_line(Point2::new(wall, 0.0), Point2::new(wall, 400.0), 3.0);
        let on = Point2::new(wall, 200.0);
        let on_wall = |area: &[f64; 4]| area[0] < wall && wall < area[2];
        assert!(labels.on_thing((on, 8.0), Point2::new(120.0, 200.0), "a television", LOOK));
        assert!(
            !on_wall(&labels.taken[0]) && labels.taken[0][2] < wall,
            "in its space"
        );
        assert!(labels.centred(on, "it", LOOK));
        assert!(labels.taken.last().is_some_and(on_wall));
    }
}
