//! The picture of a figure over two others: a table of coloured cells, and places marked between them. This
//! file guarantees that a cell is the darker the more it costs, up to twice the median above the least.

use super::canvas::{FAINT, FONT, INK, heat, line, number, rectangle, text};
use svg::Document;
use svg::node::element::{Circle, Group, Rectangle};

/// Width and height of a cell, px.
const CELL: [f64; 2] = [92.0, 44.0];
/// Left and above of the cells, px.
const MARGIN: [f64; 2] = [110.0, 84.0];
/// Below and right of them, px.
const BORDER: f64 = 30.0;
/// From line to line of the marks' names, px.
const LINE: f64 = 20.0;

/// What to draw.
#[derive(Debug, Clone, Copy)]
pub struct Surface<'a> {
    /// Above the picture.
    pub title: &'a str,
    /// What goes across, and its values in rising order.
    pub across: (&'a str, &'a [f64]),
    /// What goes down, and its values in rising order.
    pub down: (&'a str, &'a [f64]),
    /// The figure: a row for each value down, of a value for each across.
    pub values: &'a [Vec<f64>],
    /// Places to mark: down, across, and what is there.
    pub marks: &'a [(f64, f64, String)],
}

impl Surface<'_> {
    /// The picture as SVG 1.1.
    pub fn svg(&self) -> String {
        let [columns, rows] = [self.across.1.len(), self.down.1.len()].map(|count| count as f64);
        let bottom = MARGIN[1] + rows * CELL[1];
        let width = MARGIN[0] + columns * CELL[0] + BORDER;
        let height = bottom + BORDER + LINE * self.marks.len() as f64;
        let (least, most) = self.scale();
        let page = Rectangle::new()
            .set("width", "100%")
            .set("height", "100%")
            .set("fill", "#ffffff");
        let mut cells = Group::new();
        for (row, values) in self.values.iter().enumerate() {
            for (column, &value) in values.iter().enumerate() {
                cells = cells.add(cell(row, column, value, (value - least) / (most - least)));
            }
        }
        let marks = self.marks.iter().enumerate();
        let marks = marks.fold(Group::new(), |group, (k, mark)| {
            let below = bottom + BORDER + LINE * k as f64;
            group.add(self.mark(k + 1, mark, below))
        });
        let document = Document::new()
            .set(
                "viewBox",
                format!("0 0 {} {}", number(width), number(height)),
            )
            .set("width", number(width))
            .set("height", number(height))
            .set("font-family", FONT)
            .add(page)
            .add(text(20.0, 28.0, self.title, 16.0).set("fill", INK))
            .add(self.axes())
            .add(cells)
            .add(marks);
        format!("{document}\n")
    }

    /// What is lightest and what is darkest.
    fn scale(&self) -> (f64, f64) {
        let mut all: Vec<f64> = self.values.iter().flatten().copied().collect();
        all.sort_by(f64::total_cmp);
        let least = all.first().copied().unwrap_or(0.0);
        let median = all.get(all.len() / 2).copied().unwrap_or(0.0);
        (least, least + (2.0 * (median - least)).max(1e-9))
    }

    fn axes(&self) -> Group {
        let mut axes = Group::new()
            .add(text(MARGIN[0], MARGIN[1] - 28.0, self.across.0, 13.0).set("fill", INK))
            .add(text(20.0, MARGIN[1] - 8.0, self.down.0, 13.0).set("fill", INK));
        for (k, value) in self.across.1.iter().enumerate() {
            let x = MARGIN[0] + (k as f64 + 0.5) * CELL[0];
            let label = text(x, MARGIN[1] - 8.0, &number(*value), 12.0);
            axes = axes.add(label.set("fill", FAINT).set("text-anchor", "middle"));
        }
        for (k, value) in self.down.1.iter().enumerate() {
            let y = MARGIN[1] + (k as f64 + 0.5) * CELL[1] + 4.0;
            let label = text(MARGIN[0] - 12.0, y, &number(*value), 12.0);
            axes = axes.add(label.set("fill", FAINT).set("text-anchor", "end"));
        }
        axes
    }

    /// A numbered ring, and what the number means below the cells.
    fn mark(&self, index: usize, (down, across, name): &(f64, f64, String), below: f64) -> Group {
        let x = MARGIN[0] + (place(self.across.1, *across) + 0.5) * CELL[0];
        let y = MARGIN[1] + (place(self.down.1, *down) + 0.5) * CELL[1];
        let ring = Circle::new()
            .set("cx", number(x))
            .set("cy", number(y))
            .set("r", "16")
            .set("fill", "none")
            .set("stroke", "#0072b2")
            .set("stroke-width", "2.5");
        let label = format!("{index}");
        Group::new()
            .add(ring)
            .add(line(x + 11.0, y - 11.0, x + 17.0, y - 17.0).set("stroke", "#0072b2"))
            .add(text(x + 18.0, y - 14.0, &label, 12.0).set("fill", "#0072b2"))
            .add(text(MARGIN[0], below, &format!("{index}  {name}"), 13.0).set("fill", INK))
    }
}

fn cell(row: usize, column: usize, value: f64, share: f64) -> Group {
    let x = MARGIN[0] + column as f64 * CELL[0];
    let y = MARGIN[1] + row as f64 * CELL[1];
    let middle = (x + 0.5 * CELL[0], y + 0.5 * CELL[1] + 4.0);
    let ink = if share > 0.7 { "#ffffff" } else { INK };
    let label = text(middle.0, middle.1, &number(value), 12.0);
    Group::new()
        .add(rectangle(x, y, CELL[0] - 1.0, CELL[1] - 1.0).set("fill", heat(share)))
        .add(label.set("fill", ink).set("text-anchor", "middle"))
}

/// Where `value` lies among rising `values`, in steps from the first; beyond the ends at them.
fn place(values: &[f64], value: f64) -> f64 {
    let above = values.iter().position(|other| *other >= value);
    match above {
        Some(0) => 0.0,
        None => values.len().saturating_sub(1) as f64,
        Some(k) => {
            let (low, high) = (values[k - 1], values[k]);
            (k - 1) as f64 + (value - low) / (high - low).max(1e-12)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mark_lies_between_the_cells_that_it_lies_between() {
        let values = [0.02, 0.04, 0.08];
        let places = [0.01, 0.02, 0.03, 0.07, 0.08, 0.2].map(|value| place(&values, value));
        for (found, expected) in places.into_iter().zip([0.0, 0.0, 0.5, 1.75, 2.0, 2.0]) {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
    }

    #[test]
    fn the_least_cell_is_the_lightest_and_all_is_written() {
        let surface = Surface {
            title: "a <test>",
            across: ("k_r", &[0.02, 0.04]),
            down: ("k_c", &[0.1, 0.2]),
            values: &[vec![17.4, 18.0], vec![19.0, 117.0]],
            marks: &[(0.15, 0.03, "default".to_owned())],
        };
        let svg = surface.svg();
        let tree = resvg::usvg::Tree::from_str(&svg, &resvg::usvg::Options::default());
        assert!(tree.is_ok(), "{svg}");
        let lightest = heat(0.0);
        assert_eq!(svg.matches(&lightest).count(), 1, "{svg}");
        for content in ["a &lt;test&gt;", "117", "17.4", "k_r", "k_c", "1  default"] {
            assert!(svg.contains(content), "{content} in {svg}");
        }
    }
}
