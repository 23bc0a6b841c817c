#include "hal/linux/gpio/pulse_train.h"

#include <algorithm>
#include <cerrno>

namespace nodal::hal::gpio {

void PulseTrain::begin(const Train& train) {
  for (std::size_t i = 0; i < states_.size(); ++i) {
    if (states_[i].active) (void)write(i, false);
  }
  train_ = train;
  states_.assign(lines_.size(), {});
  counts_.error.store(0);
}

Instant PulseTrain::rise_of(std::size_t line, std::uint64_t number) const {
  return train_.started + train_.delay[line] + train_.rate.start_of(number);
}

Instant PulseTrain::step(Instant now) {
  Instant next = kNever;
  for (std::size_t i = 0; i < lines_.size() && train_.id != 0; ++i) {
    step_line(i, now);
    if (train_.id == 0) return kNever;
    const State& state = states_[i];
    next = std::min(next, state.active ? state.fall_at : rise_of(i, state.next));
  }
  return train_.id == 0 ? kNever : next;
}

void PulseTrain::step_line(std::size_t line, Instant now) {
  State& state = states_[line];
  if (state.active) {
    if (now < state.fall_at) return;
    // Tried again at the next wake-up when it is refused: the line must not stay active.
    state.active = !write(line, false);
    if (state.active) state.fall_at = now + kGap;
    return;
  }
  const Instant due = rise_of(line, state.next);
  if (now < due) return;
  const Duration too_late = std::min(train_.rate.period() / 4, kTooLate);
  if (now - due <= too_late) return rise(line);
  const std::uint64_t next = train_.rate.first_after(now - train_.started - train_.delay[line]);
  if (line == train_.reference) counts_.late.fetch_add(next - state.next);
  state.next = next;
}

void PulseTrain::rise(std::size_t line) {
  State& state = states_[line];
  const std::uint64_t number = state.next++;
  const Instant due = rise_of(line, number);
  const Instant before = system_.now();
  if (!write(line, true)) return;
  const Instant after = system_.now();
  state.active = true;
  // After a late rise the pulse is shortened, so that the next one still has an edge.
  state.fall_at = std::min(after + train_.width, rise_of(line, state.next) - kGap);
  const Instant at = before + (after - before) / 2;
  counts_.latest_ns.store(std::max(counts_.latest_ns.load(), (at - due).ns()));
  if (line == train_.reference) log_.add(train_.id, {number, at - train_.delay[line]});
}

bool PulseTrain::write(std::size_t line, bool active) {
  const int error = lines_[line]->write(active == train_.active_high);
  State& state = states_[line];
  if (error == 0) {
    state.refused = 0;
    return true;
  }
  if (error != ECANCELED) counts_.refused.fetch_add(1);
  if (error == ECANCELED || error == ENODEV || error == ENXIO || ++state.refused >= kRefusedInRow) end(error, line);
  return false;
}

void PulseTrain::end(int error, std::size_t line) {
  counts_.error_line.store(static_cast<std::uint32_t>(line));
  counts_.error_train.store(train_.id);
  train_.id = 0;
  counts_.error.store(error);
  for (std::size_t i = 0; i < states_.size(); ++i) {
    if (states_[i].active) (void)lines_[i]->write(!train_.active_high);
    states_[i].active = false;
  }
}

}  // namespace nodal::hal::gpio
