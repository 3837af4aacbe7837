// The works that every peer does, and how their cost is measured; see peers/README.md.
#pragma once

#include "cantilever.hpp"

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <limits>
#include <string>
#include <thread>
#include <time.h>
#include <vector>

struct Options {
  std::string work, method;
  /// A tolerance, or a number of steps a period.
  double setting = 0.0;
  int threads = 1;
  /// Where a work is stopped; what was done until then is a sample of all.
  double seconds = 1.0;
};

inline Options options_of(int argc, char **argv) {
  Options options;
  if (argc > 1) options.work = argv[1];
  for (int i = 2; i + 1 < argc; i += 2) {
    const std::string key = argv[i];
    if (key == "--method") options.method = argv[i + 1];
    if (key == "--setting") options.setting = std::atof(argv[i + 1]);
    if (key == "--threads") options.threads = std::atoi(argv[i + 1]);
    if (key == "--seconds") options.seconds = std::atof(argv[i + 1]);
  }
  return options;
}

/// Processor time on one thread, which a busy machine disturbs least; else the wall's.
inline double now(bool wall) {
  timespec t;
  clock_gettime(wall ? CLOCK_MONOTONIC : CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

constexpr int SWEEP_VALUES = 400, SWEEP_STARTS = 8, SWEEP_PERIODS = 500, SWEEP_KEPT = 100;
constexpr int BASIN_SIDE = 200, BASIN_PERIODS = 300;

/// The k-th of `count` things, so that any first few are spread over all (the steps have
/// no common divisor with the counts).
inline int scattered(int k, int count, int step) {
  return static_cast<int>((static_cast<long long>(k) * step) % count);
}

inline Parameters sweep_parameters(int value) {
  Parameters p;
  p.omega = 2.0 + 2.0 * value / (SWEEP_VALUES - 1);
  return p;
}

inline State basin_start(int point) {
  State y{};
  y[0] = -1.0 + 2.0 * (point / BASIN_SIDE) / (BASIN_SIDE - 1);
  y[MODES] = -4.0 + 8.0 * (point % BASIN_SIDE) / (BASIN_SIDE - 1);
  return y;
}

/// The starts of the sweep, from the file that all peers read.
inline std::vector<State> sweep_starts() {
  const char *path = std::getenv("SWEEP_STARTS");
  std::FILE *file = path ? std::fopen(path, "r") : nullptr;
  if (!file) {
    std::fprintf(stderr, "SWEEP_STARTS must name the file of starts\n");
    std::exit(1);
  }
  std::vector<State> starts(SWEEP_STARTS);
  for (State &start : starts)
    for (double &x : start)
      if (std::fscanf(file, "%lf%*[,\n]", &x) != 1) {
        std::fprintf(stderr, "%s does not hold 8 states\n", path);
        std::exit(1);
      }
  std::fclose(file);
  return starts;
}

/// Does items 0, 1, ... of `count` until the time is up. A batch is one call of `item`;
/// returns how many calls were made.
template <class Item>
int as_many_as_fit(const Options &options, int count, Item item) {
  std::atomic<int> next{0}, done{0};
  const double start = now(true);
  auto worker = [&] {
    while (now(true) - start < options.seconds) {
      const int k = next++;
      if (k >= count) break;
      item(k);
      done++;
    }
  };
  std::vector<std::thread> others;
  for (int i = 1; i < options.threads; i++) others.emplace_back(worker);
  worker();
  for (std::thread &other : others) other.join();
  return done;
}

inline void print_sample(double seconds, const char *what, long count) {
  std::printf("{\"seconds\": %.9g, \"%s\": %ld}\n", seconds, what, count);
}

inline void print_first(double seconds, const std::vector<State> &states) {
  std::printf("{\"seconds\": %.9g, \"states\": [", seconds);
  for (size_t k = 0; k < states.size(); k++) {
    std::printf("%s[", k ? ", " : "");
    for (int i = 0; i < DIMENSION; i++) std::printf("%s%.17g", i ? ", " : "", states[k][i]);
    std::printf("]");
  }
  std::printf("]}\n");
}

/// Does the work with a peer that follows one motion at a time:
/// `follow(options, cantilever, start, periods, at_period_end)`, where the last is called
/// with the number of the period, from 1, and the state, and says whether to go on.
template <class Follow>
int work_one_by_one(const Options &options, Follow follow) {
  const bool wall = options.threads > 1;
  if (options.work == "first") {
    const Cantilever cantilever{Parameters{}};
    double best = std::numeric_limits<double>::infinity();
    std::vector<State> states;
    const double until = now(true) + options.seconds;
    for (int repeat = 0; repeat < 3 || (repeat < 1000 && now(true) < until); repeat++) {
      states.clear();
      const double start = now(false);
      follow(options, cantilever, State{}, 20, [&](int, const State &y) {
        states.push_back(y);
        return true;
      });
      best = std::min(best, now(false) - start);
    }
    print_first(best, states);
  } else if (options.work == "long") {
    const Cantilever cantilever{Parameters{}};
    const double start = now(false), until = now(true) + options.seconds;
    int done = 0;
    follow(options, cantilever, State{}, 2000, [&](int k, const State &) {
      done = k;
      return now(true) < until;
    });
    print_sample(now(false) - start, "periods", done);
  } else if (options.work == "sweep") {
    const std::vector<State> starts = sweep_starts();
    const int count = SWEEP_VALUES * SWEEP_STARTS;
    const double start = now(wall);
    const int done = as_many_as_fit(options, count, [&](int k) {
      const int run = scattered(k, count, 1979);
      const Cantilever cantilever{sweep_parameters(run / SWEEP_STARTS)};
      std::vector<State> kept;
      follow(options, cantilever, starts[run % SWEEP_STARTS], SWEEP_PERIODS,
             [&](int period, const State &y) {
               if (period > SWEEP_PERIODS - SWEEP_KEPT) kept.push_back(y);
               return true;
             });
    });
    print_sample(now(wall) - start, "runs", done);
  } else if (options.work == "basin") {
    const Cantilever cantilever{Parameters{}};
    const int count = BASIN_SIDE * BASIN_SIDE;
    std::vector<State> ends(count);
    const double start = now(wall);
    const int done = as_many_as_fit(options, count, [&](int k) {
      const int point = scattered(k, count, 24721);
      follow(options, cantilever, basin_start(point), BASIN_PERIODS,
             [&](int period, const State &y) {
               if (period == BASIN_PERIODS) ends[point] = y;
               return true;
             });
    });
    print_sample(now(wall) - start, "runs", done);
  } else {
    std::fprintf(stderr, "works: first, long, sweep, basin\n");
    return 2;
  }
  return 0;
}
