// Boost.odeint. Methods: dopri5, whose dense output is searched for the gap's zero, and
// rkf78, whose step is done again with the length that ends on it (both by TOMS 748).
#include "work.hpp"

#include <boost/math/tools/roots.hpp>
#include <boost/numeric/odeint.hpp>

namespace odeint = boost::numeric::odeint;

namespace {

struct Rates {
  const Cantilever *cantilever;
  int regime;
  void operator()(const State &y, State &dy, double t) const {
    cantilever->rates(regime, t, y.data(), dy.data());
  }
};

/// The first zero of `gap` in (low, high], which is positive just after `low` and not at
/// `high`; `low` where it never is positive.
template <class Gap>
double zero(Gap gap, double low, double high) {
  const double start = low;
  double at_low = gap(low);
  for (double part = high - low; !(at_low > 0.0); at_low = gap(low)) {
    part *= 0.5;
    if (part < 1e-12 * (high - start)) return start;
    low = start + part;
  }
  const double at_high = gap(high);
  if (at_high == 0.0) return high;
  boost::uintmax_t iterations = 60;
  const auto digits = boost::math::tools::eps_tolerance<double>(52);
  return boost::math::tools::toms748_solve(gap, low, high, at_low, at_high, digits, iterations)
      .second;
}

/// Where the step from `low` to `high` leaves the regime, negative if it does not.
/// `gap(t)` counts as positive inside.
template <class Gap>
double crossing(Gap gap, double low, double high, double g0, double d0, double g1, double d1) {
  if (g1 <= 0.0) return zero(gap, low, high);
  if (g0 > 0.0 && dip_of_cubic(high - low, g0, d0, g1, d1) <= 0.0)
    for (int i = 1; i < 16; i++) {
      const double t = low + (high - low) * i / 16;
      if (gap(t) <= 0.0) return zero(gap, low, t);
    }
  return -1.0;
}

template <class End>
void dopri5(const Options &o, const Cantilever &c, const State &start, int periods, End end) {
  auto stepper = odeint::make_dense_output(o.setting, o.setting,
                                           odeint::runge_kutta_dopri5<State>());
  int regime = c.regime_at(0.0, start.data());
  stepper.initialize(start, 0.0, 1e-3);
  State y;
  for (int k = 1; k <= periods;) {
    const double sign = regime ? -1.0 : 1.0, before = stepper.current_time();
    const State from = stepper.current_state();
    stepper.do_step(Rates{&c, regime});
    const double after = stepper.current_time();
    const State &to = stepper.current_state();
    auto gap = [&](double t) {
      stepper.calc_state(t, y);
      return sign * c.gap(t, y.data());
    };
    const double event = crossing(gap, before, after, sign * c.gap(before, from.data()),
                                  sign * c.gap_rate(before, from.data()),
                                  sign * c.gap(after, to.data()),
                                  sign * c.gap_rate(after, to.data()));
    const double reached = event >= 0.0 ? event : after;
    for (; k <= periods && k * c.period <= reached; k++) {
      stepper.calc_state(k * c.period, y);
      if (!end(k, y)) return;
    }
    if (event >= 0.0) {
      stepper.calc_state(event, y);
      regime = 1 - regime;
      stepper.initialize(State(y), event, after - before);
    }
  }
}

template <class End>
void rkf78(const Options &o, const Cantilever &c, const State &start, int periods, End end) {
  odeint::runge_kutta_fehlberg78<State> plain;
  auto stepper = odeint::make_controlled(o.setting, o.setting, plain);
  int regime = c.regime_at(0.0, start.data());
  State y = start, next, z;
  double t = 0.0, length = 1e-2;
  for (int k = 1; k <= periods;) {
    const double sign = regime ? -1.0 : 1.0, target = k * c.period;
    const Rates rates{&c, regime};
    // A step that would pass the end of the period ends there.
    bool last = t + length >= target * (1.0 - 1e-15);
    double proposed = last ? target - t : length, reached = t;
    while (stepper.try_step(rates, y, reached, next, proposed) != odeint::success) {
      last = false;
      reached = t;
    }
    if (last) reached = target;
    const double step = reached - t;
    if (!last || proposed < length) length = proposed;
    auto gap = [&](double s) {
      if (s <= t) return sign * c.gap(t, y.data());
      plain.do_step(rates, y, t, z, s - t);
      return sign * c.gap(s, z.data());
    };
    const double event = crossing(gap, t, t + step, sign * c.gap(t, y.data()),
                                  sign * c.gap_rate(t, y.data()),
                                  sign * c.gap(reached, next.data()),
                                  sign * c.gap_rate(reached, next.data()));
    if (event >= 0.0) {
      if (event > t) {
        plain.do_step(rates, y, t, z, event - t);
        y = z;
      }
      t = event;
      regime = 1 - regime;
      continue;
    }
    y = next;
    t = reached;
    if (last && !end(k++, y)) return;
  }
}

}  // namespace

int main(int argc, char **argv) {
  return work_one_by_one(options_of(argc, argv), [](const Options &o, const auto &...rest) {
    o.method == "rkf78" ? rkf78(o, rest...) : dopri5(o, rest...);
  });
}
