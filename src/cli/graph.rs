//! The flags of `cortex graph`. Parsing a flag does nothing but parse it.

use clap::{Args, Subcommand};
use std::path::PathBuf;

#[derive(Debug, Clone, Args)]
pub(crate) struct Graph {
    #[command(subcommand)]
    pub(crate) action: GraphAction,
    #[command(flatten)]
    pub(crate) source: GraphSource,
}

/// Which graph.
#[derive(Debug, Clone, Args)]
pub(crate) struct GraphSource {
    /// Name of the running system on this host
    #[arg(
        long,
        value_name = "I",
        default_value = "default",
        global = true,
        conflicts_with = "file"
    )]
    pub(crate) instance: String,
    /// A graph file or a recording instead of a running system
    #[arg(long, value_name = "FILE", global = true)]
    pub(crate) file: Option<PathBuf>,
    /// Of a recording: as it was then, in seconds since 1970; before the recording, so long after its
    /// beginning; less than 0, so long before its end. Of `transform` also: see there
    #[arg(long, value_name = "TIME", global = true, allow_hyphen_values = true)]
    pub(crate) at: Option<f64>,
    /// For machines
    #[arg(long, global = true)]
    pub(crate) json: bool,
}

#[derive(Debug, Clone, Subcommand)]
pub(crate) enum GraphAction {
    /// Show nodes, attributes and edges
    #[command(after_help = "Example:\n  cortex graph show person --instance default")]
    Show {
        /// Only nodes of this type (or its subtypes), or the node of this name or id
        what: Option<String>,
    },
    /// Print one attribute, node or edge
    #[command(after_help = "Ends with 1 where there is no such attribute.\n\n\
        Example:\n  cortex graph get robot.radius")]
    Get {
        /// NODE, NODE.ATTRIBUTE, FROM-LABEL->TO or FROM-LABEL->TO.ATTRIBUTE
        path: String,
        /// Writes a large value itself, byte by byte, instead of printing its handle
        #[arg(long, value_name = "FILE", conflicts_with = "file")]
        bytes: Option<PathBuf>,
    },
    /// Set one attribute of a running system, or in a file
    #[command(
        after_help = "The value is JSON of the kind that the schema names; a bare word is a text, and \
        a pose may be [x, y, heading].\n\nExample:\n  cortex graph set robot.max_speed 0.4"
    )]
    Set {
        /// NODE.ATTRIBUTE, or FROM-LABEL->TO.ATTRIBUTE
        path: String,
        /// The value, as in graph JSON
        #[arg(allow_hyphen_values = true)]
        value: String,
    },
    /// Print commits as they come
    #[command(
        after_help = "A commit passes if it touches anything named. With --json, a line per commit.\n\n\
        Example:\n  cortex graph watch in --count 10"
    )]
    Watch(Watch),
    /// Show what an attribute, node or edge was, as far back as the graph keeps it
    #[command(
        after_help = "Newest first. The first line says how far back the graph's versions go; of an \
        attribute with a history in the schema, older values may be shown.\n\n\
        Example:\n  cortex graph history robot.velocity --limit 20"
    )]
    History {
        /// NODE, NODE.ATTRIBUTE, FROM-LABEL->TO or FROM-LABEL->TO.ATTRIBUTE
        path: String,
        /// Only the newest so many
        #[arg(long, value_name = "N")]
        limit: Option<usize>,
    },
    /// Print the whole graph: json, robocomp, dot or graphml
    #[command(after_help = "Example:\n  cortex graph export json --file world.json")]
    Export {
        /// Graph JSON, RoboComp DSR JSON, Graphviz DOT or GraphML
        format: ExportFormat,
    },
    /// Bring what a file says into a running system, or into another file
    #[command(
        after_help = "Nodes are the same if their names are. What is new is added, what differs becomes as in \
        the file, the rest stays; all in one transaction. The file is checked against the schema \
        first.\n\nExample:\n  cortex graph import world.json --instance default"
    )]
    Import {
        /// Graph JSON, RoboComp DSR JSON or AGM model XML
        #[arg(value_name = "FILE")]
        from: PathBuf,
        /// Also take away what the file does not have: nodes, edges and attributes
        #[arg(long)]
        replace: bool,
    },
    /// Compare two graphs by names; 1 where they differ
    #[command(
        after_help = "Each is a file, or @INSTANCE for a running system. Without B, A is compared with that of \
        --instance or --file.\n\nExample:\n  cortex graph diff before.json @default"
    )]
    Diff {
        /// A file, or @INSTANCE
        a: String,
        /// A file, or @INSTANCE
        b: Option<String>,
    },
    /// Tell everything that is wrong with a graph; 1 where anything is
    #[command(
        after_help = "Against a schema: unknown types, labels and attributes, wrong kinds, ranges and ends. Without \
        one: links to nowhere, broken and disconnected trees of poses.\n\n\
        Example:\n  cortex graph check --file world.json --schema schema.toml"
    )]
    Check {
        /// A schema (.toml) [default: that of the instance; none for a file]
        #[arg(long, value_name = "FILE")]
        schema: Option<PathBuf>,
    },
    /// Print where a node is, seen from another, along the poses
    #[command(
        after_help = "With --at TIME, where it was then: in seconds since 1970, or before 0, so long before \
        the newest version. Ends with 1 where the graph does not know it.\n\n\
        Example:\n  cortex graph transform world robot --at -0.5"
    )]
    Transform {
        /// The node to look from
        target: String,
        /// The node to look at
        source: String,
    },
}

/// A format that graphs are written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum ExportFormat {
    Json,
    Robocomp,
    Dot,
    Graphml,
}

/// Which commits to print.
#[derive(Debug, Clone, Args)]
pub(crate) struct Watch {
    /// Only commits that touch a type, label, attribute or node of this name
    pub(crate) filter: Vec<String>,
    /// ... nodes of this type or its subtypes
    #[arg(long = "type", value_name = "TYPE")]
    pub(crate) types: Vec<String>,
    /// ... edges of this label
    #[arg(long = "label", value_name = "LABEL")]
    pub(crate) labels: Vec<String>,
    /// ... this attribute
    #[arg(long = "attribute", value_name = "NAME")]
    pub(crate) attributes: Vec<String>,
    /// ... this node or its edges
    #[arg(long = "node", value_name = "NODE")]
    pub(crate) nodes: Vec<String>,
    /// End after so many
    #[arg(long, value_name = "N")]
    pub(crate) count: Option<u64>,
}
