//! The `cortex` program as the tests run it.
fn main() -> std::process::ExitCode {
    cortex::main()
}
