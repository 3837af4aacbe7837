//! Rust's ODE crates on the works of peers/README.md. Methods: `ode_solvers` (Dormand and
//! Prince 5), `differential_equations` (DOP853), `diffsol_tsit45`, `diffsol_bdf`. The
//! setting is the tolerance.

mod cantilever;
mod differential_equations_peer;
mod diffsol_peer;
mod ode_solvers_peer;
mod work;

fn main() {
    let options = work::Options::read();
    let tolerance = options.tolerance;
    work::work(
        &options,
        &|cantilever, start, periods, at_end| match options.method.as_str() {
            "ode_solvers" => {
                ode_solvers_peer::follow(tolerance, cantilever, start, periods, at_end);
            }
            "differential_equations" => {
                differential_equations_peer::follow(tolerance, cantilever, start, periods, at_end);
            }
            "diffsol_tsit45" => {
                diffsol_peer::follow(false, tolerance, cantilever, start, periods, at_end);
            }
            "diffsol_bdf" => {
                diffsol_peer::follow(true, tolerance, cantilever, start, periods, at_end);
            }
            other => panic!("no method is called `{other}`"),
        },
    );
}
