//! The flags of `cortex social` and `cortex experiment`. Parsing a flag does nothing but parse it.

use agents::social_mapping::groups::Method;
use agents::social_mapping::preset::Preset;
use agents::social_mapping::{Layer, Levels, Proxemics, UsageCurve};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Subcommand};
use std::path::PathBuf;

#[derive(Debug, Clone, Args)]
pub(crate) struct Social {
    #[command(subcommand)]
    pub(crate) action: SocialAction,
}

#[derive(Debug, Clone, Subcommand)]
pub(crate) enum SocialAction {
    /// Find who stands together, frame by frame, and score that where the truth is known
    #[command(
        after_help = "A group of the truth counts as found where at least 2/3 of its members (or \
        all, at tolerance 1)\nare in one group found, of which at most the rest are wrong.\n\n\
        Example:\n  cortex social groups recording.json --method triangulation_strict"
    )]
    Groups {
        /// People frame by frame (JSON)
        file: PathBuf,
        /// How groups are found
        #[arg(long, value_name = "M", default_value = Method::default().name(), value_parser = method())]
        method: Method,
        /// A line of JSON for each frame, and one with the scores
        #[arg(long)]
        json: bool,
    },
    /// Say how little the robot's place suits it, scene by scene: 0 nobody minds, 1 the worst
    #[command(
        after_help = "With --folds, the figures are also chosen anew on all scenes but a part, for each of K \
        parts,\nand held against people's ratings on that part.\n\n\
        Examples:\n  cortex social comfort scenes.json --json\n  \
        cortex social comfort scenes.json --folds 5"
    )]
    Comfort {
        /// One scene a line (JSON), the robot at its origin
        file: PathBuf,
        /// Cross-validate against people's ratings in K parts
        #[arg(long, value_name = "K", value_parser = clap::value_parser!(u16).range(2..))]
        folds: Option<u16>,
        /// A line of JSON for each scene
        #[arg(long)]
        json: bool,
    },
    /// Put a schedule into effect in a running system: what is done with which object and when
    #[command(
        after_help = "Afterwards the activities of the graph are those of the file.\n\n\
        Example:\n  cortex social schedule scenarios/care-centre/schedule.toml"
    )]
    Schedule {
        /// Tables [[activity]] (TOML)
        file: PathBuf,
        /// The instance of the running system
        #[arg(long, value_name = "I", default_value = "default")]
        instance: String,
    },
    /// Draw people's density with contours, headings, groups and the spaces of objects
    #[command(
        after_help = "Example:\n  cortex social density scenarios/care-centre --at 09:40 --out density.png"
    )]
    Density(SocialPicture),
    /// Draw what places cost the robot, or write that as a ROS map (.yaml and .pgm)
    #[command(
        after_help = "Examples:\n  cortex social map scenarios/care-centre --out costs.png\n  \
        cortex social map recording.json --at 12 --out costs.yaml\n  \
        cortex social map scenarios/care-centre --layer inflation --out walls.png"
    )]
    Map {
        #[command(flatten)]
        picture: SocialPicture,
        /// How much of the map, each built on those before but for the social one
        #[arg(long, value_name = "L", default_value = Layer::default().name(), value_parser = layer())]
        layer: Layer,
        /// How a ROS map tells costs: `scale` by greys, `raw` by the value of a pixel, `trinary` not at all
        /// [default: scale]
        #[arg(long, value_name = "R", value_parser = ros_mode())]
        ros_mode: Option<RosMode>,
    },
}

#[derive(Debug, Clone, Args)]
pub(crate) struct SocialPicture {
    /// A recording of people frame by frame (JSON), or a scenario's folder
    pub(crate) file: PathBuf,
    /// When: a recording's last frame until this time, or a time of the scenario's day, HH:MM, which moves R(t), and
    /// people to where their schedules have them [default: the start]
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    pub(crate) at: Option<String>,
    /// Where to; the ending decides what
    #[arg(long, value_name = "FILE")]
    pub(crate) out: PathBuf,
    /// Figures of social mapping: a file with a table [social] [default: those of the scenario]
    #[arg(long, value_name = "FILE")]
    pub(crate) settings: Option<PathBuf>,
    /// How groups are found [default: as the figures say]
    #[arg(long, value_name = "M", value_parser = method())]
    pub(crate) method: Option<Method>,
    /// People's widths and levels by name [default: as the figures say]
    #[arg(long, value_name = "P", value_parser = preset::<Proxemics>())]
    pub(crate) proxemics: Option<Proxemics>,
    /// The densities at which zones end by name [default: as the figures say]
    #[arg(long, value_name = "L", value_parser = preset::<Levels>())]
    pub(crate) levels: Option<Levels>,
    /// R(t) by name [default: as the figures say]
    #[arg(long, value_name = "U", value_parser = preset::<UsageCurve>())]
    pub(crate) usage: Option<UsageCurve>,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct Experiment {
    /// `list`, or the name of an experiment
    pub(crate) name: String,
    /// How often to repeat what chance plays a part in
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub(crate) seeds: u64,
    /// For `perception`: recorded pedestrians (`obsmat.txt`, or frame id x y) in place of simulated ones; for
    /// `compare`: one more world with them
    #[arg(long, value_name = "FILE")]
    pub(crate) tracks: Option<PathBuf>,
    /// For `tg-shapes`, `tg-groups` and `td-gains`: write the figures as ours are to this folder (.svg and .png)
    #[arg(long, value_name = "DIR")]
    pub(crate) pictures: Option<PathBuf>,
    /// For machines
    #[arg(long)]
    pub(crate) json: bool,
}

/// How a map server reads the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum RosMode {
    /// Free or occupied, and nothing between.
    Trinary,
    /// White is free, black occupied, and grey between tells the cost.
    #[default]
    Scale,
    /// The value of a pixel is the occupancy, 0 to 100.
    Raw,
}

impl RosMode {
    /// All modes.
    pub(crate) const ALL: [Self; 3] = [Self::Trinary, Self::Scale, Self::Raw];

    /// Its name, on the command line and in ROS.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Trinary => "trinary",
            Self::Scale => "scale",
            Self::Raw => "raw",
        }
    }
}

fn layer() -> impl TypedValueParser<Value = Layer> {
    PossibleValuesParser::new(Layer::ALL.map(Layer::name)).map(|name| {
        let named = |layer: &Layer| layer.name() == name;
        Layer::ALL.into_iter().find(named).unwrap_or_default()
    })
}

fn ros_mode() -> impl TypedValueParser<Value = RosMode> {
    PossibleValuesParser::new(RosMode::ALL.map(RosMode::name)).map(|name| {
        let named = |mode: &RosMode| mode.name() == name;
        RosMode::ALL.into_iter().find(named).unwrap_or_default()
    })
}

fn preset<T: Preset + Clone + Send + Sync + Default>() -> impl TypedValueParser<Value = T> {
    let names = T::PRESETS.iter().map(|(name, _)| *name);
    PossibleValuesParser::new(names).map(|name| T::find_preset(&name).unwrap_or_default())
}

fn method() -> impl TypedValueParser<Value = Method> {
    PossibleValuesParser::new(Method::ALL.map(Method::name)).map(|name| {
        let named = |method: &Method| method.name() == name;
        Method::ALL.into_iter().find(named).unwrap_or_default()
    })
}
