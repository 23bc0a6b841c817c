#include "firmware/daemon/threads.h"

#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <memory>
#include <utility>

#include "firmware/daemon/memory.h"

namespace nodal::daemon {
namespace {

constexpr std::chrono::microseconds kSleep{100'000};  ///< timeout of threads that only a bell wakes
constexpr int kSeamsNice = 10;

}  // namespace

RigThreads::RigThreads(firmware::Rig& rig, hal::ClockPort& clock, int blend_threads, Hooks hooks)
    : rig_(rig), hooks_(std::move(hooks)), capture_bell_(clock), control_bell_(clock) {
  try {
    start(blend_threads);
  } catch (...) {
    stop();
    throw;
  }
}

RigThreads::~RigThreads() { stop(); }

/// A thread that steps until there is no work, and then sleeps until the bell rings that it read before the last step.
template <class AnyBell, class Step, class Sleep>
void RigThreads::add(const char* name, AnyBell& bell, Step step, Sleep sleep) {
  const auto count = std::make_shared<std::uint64_t>(0);
  threads_.push_back({name, hal::Thread(
                                name,
                                [this, &bell, count, step = std::move(step)]() mutable {
                                  if (stop_.load()) return hal::Round::kEnd;
                                  *count = bell.count();
                                  return step() ? hal::Round::kAgain : hal::Round::kSleep;
                                },
                                [count, sleep = std::move(sleep)] { sleep(*count); })});
}

template <class Step>
void RigThreads::add(const char* name, Bell& bell, Step step) {
  add(name, bell, std::move(step), [&bell](std::uint64_t count) { bell.wait(count, kSleep); });
}

void RigThreads::start(int blend_threads) {
  add_control();
  add_keeper();
  add_encode();
  for (int i = 0; i < blend_threads; ++i) add_blend();
  if (rig_.places_seams()) add_seams();
  if (rig_.records()) add_takes();
  add_capture();
}

void RigThreads::stop() {
  stop_.store(true);
  for (Bell* bell :
       {&blend_bell_, &encode_bell_, &seams_bell_, &keeper_bell_, &record_bell_, &takes_bell_, &read_bell_})
    bell->ring_all();
  for (PortBell* bell : {&capture_bell_, &control_bell_}) bell->ring();
  for (Named& each : threads_) {
    hooks_.waits_for(each.name);
    each.thread.join();
  }
}

bool RigThreads::frame_path_empty() const {
  firmware::Blender& blender = rig_.blender();
  if (rig_.records() && !rig_.recorder().idle()) return false;
  return blender.sets_in().empty() && rig_.seams().idle() && blender.idle() &&
         blender.counts().blended.load() == rig_.encoder().steps();
}

void RigThreads::add_capture() {
  const auto step = [this, sets = std::uint64_t{0}]() mutable {
    firmware::Capture& capture = rig_.capture();
    const bool asked = !capture.requests().empty();
    if (!rig_.step_capture()) return false;
    capture_bell_.worked();
    const std::uint64_t now = capture.report().sets;
    const bool set = std::exchange(sets, now) != now;
    if (set) {
      blend_bell_.ring();
      record_bell_.ring();
    }
    if (asked || rig_.hosts_have_sets()) control_bell_.ring();  // it answers requests and sends the heads' pictures
    return true;
  };
  add("nodal-capture", capture_bell_, step, [this](std::uint64_t count) {
    hal::WakeUps wake_ups;
    rig_.capture().add_wake_ups(wake_ups);
    if (hooks_.advance && frame_path_empty()) {
      hooks_.advance(*wake_ups.at());
    } else {
      capture_bell_.wait(count, wake_ups);
    }
  });
}

void RigThreads::add_blend() {
  struct Seen {
    std::uint64_t blended = 0, finished = 0, adopted = 0;
  };
  add("nodal-blend", blend_bell_, [this, seen = Seen()]() mutable {
    const firmware::Blender::Counts& counts = rig_.blender().counts();
    if (!rig_.step_blend()) return false;
    if (!rig_.blender().idle()) blend_bell_.ring();
    if (!rig_.seams().idle()) seams_bell_.ring();
    if (const auto now = counts.blended.load(); std::exchange(seen.blended, now) != now) encode_bell_.ring();
    // The heads get their buffers back.
    if (const auto now = counts.finished(); std::exchange(seen.finished, now) != now) capture_bell_.ring();
    if (const auto now = counts.adopted.load(); std::exchange(seen.adopted, now) != now) keeper_bell_.ring();
    return true;
  });
}

void RigThreads::add_encode() {
  add("nodal-encode", encode_bell_, [this] {
    if (!rig_.step_encode()) return false;
    control_bell_.ring();
    record_bell_.ring();
    blend_bell_.ring();                        // the blend may wait for room in the encoder's ring
    if (hooks_.advance) capture_bell_.ring();  // virtual time waits for the end of the frame path
    return true;
  });
}

/// Adds the thread that places seams. Its priority is low: if it is late, the seams stay where they are.
void RigThreads::add_seams() {
  add("nodal-seams", seams_bell_, [this, first = true]() mutable {
    if (std::exchange(first, false)) setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kSeamsNice);
    if (!rig_.step_seams()) return false;
    if (hooks_.advance) capture_bell_.ring();  // virtual time waits for the seams, too
    return true;
  });
}

void RigThreads::add_keeper() {
  add("nodal-keeper", keeper_bell_, [this, adopted = std::uint64_t{0}]() mutable {
    // Before the step, so that the step frees the old table.
    const std::uint64_t now = rig_.blender().counts().adopted.load();
    if (rig_.step_keeper()) {
      blend_bell_.ring();
      control_bell_.ring();
      return true;
    }
    if (std::exchange(adopted, now) != now) give_back_memory();
    return false;
  });
}

void RigThreads::add_takes() {
  add("nodal-takes", takes_bell_, [this] {
    if (!rig_.step_takes()) return false;
    record_bell_.ring();   // orders, rows that are free again
    read_bell_.ring();     // reading waits while the recorder's memory is filled
    control_bell_.ring();  // answers
    if (hooks_.advance) capture_bell_.ring();
    return true;
  });
  add("nodal-read", read_bell_, [this] {
    if (!rig_.step_take_reader()) return false;
    control_bell_.ring();
    return true;
  });
  add("nodal-record", record_bell_, [this] {
    if (!rig_.step_record()) return false;
    takes_bell_.ring();
    capture_bell_.ring();  // the heads get their buffers back
    return true;
  });
}

void RigThreads::add_control() {
  const auto step = [this] {
    const bool busy = rig_.step_control();
    for (const std::string& sentence : rig_.control().take_news()) hooks_.log(sentence);
    if (!busy) return false;
    control_bell_.worked();
    keeper_bell_.ring();
    takes_bell_.ring();
    read_bell_.ring();
    capture_bell_.ring();
    encode_bell_.ring();
    return true;
  };
  add("nodal-control", control_bell_, step, [this](std::uint64_t count) {
    hal::WakeUps wake_ups;
    rig_.control().add_wake_ups(wake_ups);
    control_bell_.wait(count, wake_ups);
  });
}

}  // namespace nodal::daemon
