// The result of a run as Python sees it, and what checkpoints get of it while it is computed.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "checkpoints.hpp"
#include "interrupt.hpp"
#include "problem.hpp"

namespace bellcrank {

namespace nb = nanobind;

// A new array that Python owns, with `columns` columns or, for 0, of one dimension.
template <class T>
nb::object copied(const T* values, std::size_t count, std::size_t columns = 0) {
  auto memory = std::make_unique<T[]>(count);
  std::copy(values, values + count, memory.get());
  T* data = memory.release();
  nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<T*>(p); });
  if (columns) return nb::cast(nb::ndarray<nb::numpy, T, nb::ndim<2>>(data, {count / columns, columns}, owner));
  return nb::cast(nb::ndarray<nb::numpy, T, nb::ndim<1>>(data, {count}, owner));
}

// The entries from `from` on, which becomes the number of entries.
template <class T>
nb::object rest(const std::vector<T>& values, std::size_t* from, std::size_t columns = 0) {
  const std::size_t first = *from;
  *from = values.size();
  return copied(values.data() + first, values.size() - first, columns);
}

// What a checkpoint gets: what was found since the one before.
struct StepBlock {
  nb::object held_time, held_values;
  nb::object time, state, event_index, event_time, event_state, steps, end_state;
  nb::object switch_time, event_counts, unresolved_count, unresolved_time, undefined_count, undefined_time;
  double end_time = 0, seconds = 0, longest_step = 0;
  std::int64_t switches = 0;
  Counts counts;
};

// Collects what the engine finds.
class StepResult final : public Record {
 public:
  StepResult(int n, double t0, int event_count, nb::object progress, nb::object checkpoint, double interval)
      : n(n), watch(std::move(progress)), checkpoints(std::move(checkpoint), interval), event_counts(event_count),
        last_events(event_count), unresolved_count(event_count), undefined_count(event_count),
        unresolved_time(event_count), undefined_time(event_count), last_step(t0) {
    steps.push_back(t0);
    more_steps();
  }

  void more_steps() override {
    if (next_step) take_steps();
    const std::size_t used = steps.size();
    steps.resize(used + std::min(std::max(used, room), 2 * most_steps + 1 - used));
    fresh = used;
    next_step = steps.data() + used;
    steps_end = steps.data() + steps.size();
  }
  // Takes the steps in that were written since, and keeps their last end whatever is thinned.
  void finish_steps() {
    const double last = next_step == steps.data() + fresh ? last_step : next_step[-1];
    take_steps();
    if (steps.back() != last) steps.push_back(last);
  }
  // After the run. The state at its end is one more row where it ended early.
  void finish() {
    finish_steps();
    finish_events();
    if (time.empty() || (status != Status::finished && time.back() < end_time)) output(end_time, end_state.data());
    double sum = 0;
    for (double x : state) sum += x * 0.0;
    finite = sum == 0;
    std::int64_t found = 0, doubtful = 0;
    for (std::int64_t count : event_counts) found += count;
    for (std::int64_t count : unresolved_count) doubtful += count;
    for (std::int64_t count : undefined_count) doubtful += count;
    events_complete = doubtful == 0 && found == static_cast<std::int64_t>(event_index.size());
  }
  void output(double t, const double* x) override {
    time.push_back(t);
    state.insert(state.end(), x, x + n);
  }
  // Of more than `most_events` in all, each event function keeps its first `least_events` and its last.
  void event(int index, double t, const double* x) override {
    const std::int64_t nth = event_counts[index]++;
    Last& last = last_events[index];
    if (event_index.size() < most_events || nth < least_events) {
      last.pending = false;
      keep_event(index, t, x);
    } else {
      last.pending = true, last.time = t;
      last.state.assign(x, x + n);
    }
  }
  void finish_events() {
    std::vector<int> left;
    for (int e = 0; e < static_cast<int>(last_events.size()); ++e)
      if (last_events[e].pending) left.push_back(e);
    std::stable_sort(left.begin(), left.end(), [&](int a, int b) { return last_events[a].time < last_events[b].time; });
    for (int e : left) {  // among those that some event functions kept to the end, in the order of time
      const Last& last = last_events[e];
      const auto at = std::upper_bound(event_time.begin(), event_time.end(), last.time) - event_time.begin();
      event_index.insert(event_index.begin() + at, e);
      event_time.insert(event_time.begin() + at, last.time);
      event_state.insert(event_state.begin() + at * n, last.state.begin(), last.state.end());
    }
  }
  void unresolved(int index, double t) override {
    if (!unresolved_count[index]++) unresolved_time[index] = t;
  }
  void undefined(int index, double t) override {
    if (!undefined_count[index]++) undefined_time[index] = t;
  }
  void switched(double t, bool) override {
    if (switch_time.size() < most_switches) switch_time.push_back(t);
    ++switches;
  }
  void hold(double t, const double* values) override {
    if (held_time.size() > given.held_time && held_time.back() == t) held_values.resize(held_values.size() - held_count);
    else held_time.push_back(t);
    held_values.insert(held_values.end(), values, values + held_count);
  }
  // Calls Python, `updates[k]`(t, x, values) -> the values anew.
  bool update(int k, double t, const double* x, double* values) override {
    nb::gil_scoped_acquire gil;
    const std::size_t count = held_count - switch_count;
    nb::object answer = nb::steal(PyObject_CallFunctionObjArgs(nb::handle(updates[k]).ptr(), nb::cast(t).ptr(),
        copied(x, n).ptr(), copied(values, count).ptr(), nullptr));
    if (!answer.is_valid()) return watch.failed(), false;
    const auto found = nb::cast<nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>>(answer);
    std::copy(found.data(), found.data() + count, values);
    return true;
  }
  void end(double t, const double* x) override {
    end_time = t;
    end_state.assign(x, x + n);
  }
  bool look(double t, const double* x, const Counts& now, std::int64_t* attempts) override {
    if (watch.look(t, attempts)) return true;
    if (!checkpoints.due()) return false;
    nb::gil_scoped_acquire gil;
    return !checkpoints.hand_over(block(t, x, now)) && watch.failed();
  }

  static constexpr std::size_t room = 1024, most_steps = 100'000, most_events = 100'000, most_switches = 1000;
  static constexpr std::int64_t least_events = 100;
  int n;
  std::vector<double> time, state, end_state, steps, event_time, event_state;
  std::vector<int> event_index;
  std::vector<double> switch_time;  // to the implicit method first, then back, and so on
  std::int64_t switches = 0;
  double end_time = 0, seconds = 0, longest_step = 0;
  bool finite = true;           // all states
  bool events_complete = true;  // all events are kept, and no crossing may have been missed
  std::chrono::steady_clock::time_point begun;
  Status status = Status::finished;
  Counts counts;
  Watch watch;
  Checkpoints checkpoints;
  std::vector<std::int64_t> event_counts;
  std::size_t held_count = 0, switch_count = 0;
  nb::object updates;
  std::vector<double> held_time, held_values;  // (m), (m, held_count)
  std::vector<double> least_values, largest_values;  // the extremes of what is observed

 private:
  struct Last {
    bool pending = false;
    double time = 0;
    std::vector<double> state;
  };
  std::vector<Last> last_events;

 public:
  std::vector<std::int64_t> unresolved_count, undefined_count;
  std::vector<double> unresolved_time, undefined_time;  // of the first, by event function

 private:
  std::size_t fresh = 0;      // where the steps begin that were written since the last look
  std::int64_t number = 1;    // of the first of these; the start is step 0
  std::int64_t stride = 1;    // steps whose number is a multiple of it, a power of two, are kept
  double last_step;

  struct Marks {
    std::size_t held_time = 0, held_values = 0, time = 0, state = 0, event_index = 0, event_time = 0, event_state = 0;
  } given;  // to Python already

  // What was found since the last block; steps, which are decimated as they become more, and counts are all so far.
  nb::object block(double t, const double* x, const Counts& now) {
    StepBlock found;
    found.counts = now;
    found.end_time = t;
    found.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
    found.end_state = copied(x, n);
    found.held_time = rest(held_time, &given.held_time);
    found.held_values = rest(held_values, &given.held_values, std::max<std::size_t>(held_count, 1));
    found.time = rest(time, &given.time);
    found.state = rest(state, &given.state, n);
    found.event_index = rest(event_index, &given.event_index);
    found.event_time = rest(event_time, &given.event_time);
    found.event_state = rest(event_state, &given.event_state, n);
    more_steps();
    std::vector<double> ends(steps.begin(), steps.begin() + fresh);
    if (ends.back() != last_step) ends.push_back(last_step);
    found.longest_step = longest_step;
    found.steps = copied(ends.data(), ends.size());
    found.switches = switches, found.switch_time = copied(switch_time.data(), switch_time.size());
    found.event_counts = copied(event_counts.data(), event_counts.size());
    found.unresolved_count = copied(unresolved_count.data(), unresolved_count.size());
    found.unresolved_time = copied(unresolved_time.data(), unresolved_time.size());
    found.undefined_count = copied(undefined_count.data(), undefined_count.size());
    found.undefined_time = copied(undefined_time.data(), undefined_time.size());
    return nb::cast(std::move(found));
  }

  void keep_event(int index, double t, const double* x) {
    event_index.push_back(index);
    event_time.push_back(t);
    event_state.insert(event_state.end(), x, x + n);
  }
  // The longest of the new steps, and of their ends those that are kept: of more than `most_steps` every other one.
  void take_steps() {
    std::size_t kept = fresh;
    for (const double* end = steps.data() + fresh; end != next_step; ++end, ++number) {
      longest_step = std::max(longest_step, *end - last_step);
      last_step = *end;
      if ((number & (stride - 1)) == 0) steps[kept++] = *end;
    }
    for (; kept > most_steps + 1; kept = (kept + 1) / 2, stride *= 2)
      for (std::size_t i = 0; 2 * i < kept; ++i) steps[i] = steps[2 * i];
    steps.resize(kept);
  }
};

}  // namespace bellcrank
