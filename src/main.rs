//! The `cortex` program: see `cortex --help`.
fn main() -> std::process::ExitCode {
    cortex::main()
}
