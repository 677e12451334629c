//! From SVG to PNG, with an embedded font: the same picture on every machine, with or without
//! fonts installed.

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{self, Options, Tree};

/// The font of all text, see [`super::canvas::FONT`].
const FAMILY: &str = "DejaVu Sans";

/// Why there is no PNG.
#[derive(Debug, thiserror::Error)]
pub enum PngError {
    /// The text is no SVG.
    #[error("the picture is no SVG")]
    Svg(#[from] usvg::Error),
    /// No such picture fits into memory.
    #[error("a picture of {width} x {height} pixels cannot be made")]
    Size {
        /// Pixels across.
        width: f32,
        /// Pixels down.
        height: f32,
    },
    /// The pixels could not be written.
    #[error("the picture cannot be encoded: {reason}")]
    Encode {
        /// What the encoder said.
        reason: String,
    },
}

/// Draws an SVG with `scale` pixels for each of its own.
///
/// # Errors
/// [`PngError`], where `svg` is none or the picture would have no pixel or too many.
pub fn png(svg: &str, scale: f32) -> Result<Vec<u8>, PngError> {
    let mut options = Options {
        font_family: FAMILY.to_owned(),
        ..Options::default()
    };
    let fonts = options.fontdb_mut();
    fonts.load_font_data(dejavu::sans::regular().to_vec());
    fonts.load_font_data(dejavu::sans::bold().to_vec());
    fonts.set_sans_serif_family(FAMILY);
    let tree = Tree::from_str(svg, &options)?;
    let (width, height) = (tree.size().width() * scale, tree.size().height() * scale);
    let mut pixels = Pixmap::new(width.ceil() as u32, height.ceil() as u32)
        .ok_or(PngError::Size { width, height })?;
    resvg::render(
        &tree,
        Transform::from_scale(scale, scale),
        &mut pixels.as_mut(),
    );
    pixels.encode_png().map_err(|error| PngError::Encode {
        reason: error.to_string(),
    })
}
