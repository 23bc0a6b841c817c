#include "firmware/daemon/threads.h"

#include <pthread.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
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

void RigThreads::start(int blend_threads) {
  const auto add = [this](const char* name, void (RigThreads::*run)()) {
    threads_.push_back({name, std::thread([this, run] { (this->*run)(); })});
    pthread_setname_np(threads_.back().thread.native_handle(), name);
  };
  add("nodal-control", &RigThreads::control);
  add("nodal-keeper", &RigThreads::keep);
  add("nodal-encode", &RigThreads::encode);
  for (int i = 0; i < blend_threads; ++i) add("nodal-blend", &RigThreads::blend);
  if (rig_.places_seams()) add("nodal-seams", &RigThreads::place_seams);
  if (rig_.records()) {
    add("nodal-takes", &RigThreads::takes);
    add("nodal-read", &RigThreads::read_takes);
    add("nodal-record", &RigThreads::record);
  }
  add("nodal-capture", &RigThreads::capture);
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

void RigThreads::capture() {
  std::uint64_t sets = 0;
  while (!stop_.load()) {
    const auto heard = capture_bell_.count();
    firmware::Capture& capture = rig_.capture();
    const bool asked = !capture.commands().empty();
    if (rig_.step_capture()) {
      capture_bell_.worked();
      const std::uint64_t now = capture.report().sets;
      const bool set = std::exchange(sets, now) != now;
      if (set) {
        blend_bell_.ring();
        record_bell_.ring();
      }
      if (asked || rig_.hosts_have_sets()) control_bell_.ring();  // for the answers; for the heads' pictures
      continue;
    }
    hal::WakeUps wake_ups;
    capture.add_wake_ups(wake_ups);
    if (hooks_.advance && frame_path_empty()) {
      hooks_.advance(*wake_ups.at());
    } else {
      capture_bell_.wait(heard, wake_ups);
    }
  }
}

void RigThreads::blend() {
  const firmware::Blender::Counts& counts = rig_.blender().counts();
  std::uint64_t blended = 0;
  std::uint64_t finished = 0;
  std::uint64_t adopted = 0;
  while (!stop_.load()) {
    const auto heard = blend_bell_.count();
    if (!rig_.step_blend()) {
      blend_bell_.wait(heard, kSleep);
      continue;
    }
    if (!rig_.blender().idle()) blend_bell_.ring();
    if (!rig_.seams().idle()) seams_bell_.ring();
    if (const auto now = counts.blended.load(); std::exchange(blended, now) != now) encode_bell_.ring();
    // The heads get their buffers back.
    if (const auto now = counts.finished(); std::exchange(finished, now) != now) capture_bell_.ring();
    if (const auto now = counts.adopted.load(); std::exchange(adopted, now) != now) keeper_bell_.ring();
  }
}

void RigThreads::encode() {
  while (!stop_.load()) {
    const auto heard = encode_bell_.count();
    if (rig_.step_encode()) {
      control_bell_.ring();
      record_bell_.ring();
      blend_bell_.ring();                        // the blend may wait for room in the encoder's ring
      if (hooks_.advance) capture_bell_.ring();  // virtual time waits for the end of the frame path
    } else {
      encode_bell_.wait(heard, kSleep);
    }
  }
}

/// Of low priority: seams that are late stay where they are.
void RigThreads::place_seams() {
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kSeamsNice);
  step_by_bell(
      seams_bell_, [&] { return rig_.step_seams(); },
      [&] {
        if (hooks_.advance) capture_bell_.ring();  // virtual time waits for the seams, too
      });
}

void RigThreads::keep() {
  std::uint64_t adopted = 0;
  while (!stop_.load()) {
    const auto heard = keeper_bell_.count();
    const std::uint64_t now =
        rig_.blender().counts().adopted.load();  // before the step, so that the step frees the old table
    if (rig_.step_keeper()) {
      blend_bell_.ring();
      control_bell_.ring();
    } else {
      if (std::exchange(adopted, now) != now) give_back_memory();
      keeper_bell_.wait(heard, kSleep);
    }
  }
}

/// Steps until the end; sleeps on the bell while there is no work. `after` rings the bells of those who wait for the work.
template <class Step, class After>
void RigThreads::step_by_bell(Bell& bell, Step step, After after) {
  while (!stop_.load()) {
    const auto heard = bell.count();
    if (step()) after();
    else bell.wait(heard, kSleep);
  }
}

void RigThreads::record() {
  step_by_bell(
      record_bell_, [&] { return rig_.step_record(); },
      [&] {
        takes_bell_.ring();
        capture_bell_.ring();  // the heads get their buffers back
      });
}

void RigThreads::takes() {
  step_by_bell(
      takes_bell_, [&] { return rig_.step_takes(); },
      [&] {
        record_bell_.ring();   // orders, rows that are free again
        read_bell_.ring();     // reading waits while the recorder's memory is filled
        control_bell_.ring();  // answers
        if (hooks_.advance) capture_bell_.ring();
      });
}

void RigThreads::read_takes() {
  step_by_bell(
      read_bell_, [&] { return rig_.step_take_reader(); }, [&] { control_bell_.ring(); });
}

void RigThreads::control() {
  while (!stop_.load()) {
    const auto heard = control_bell_.count();
    const bool busy = rig_.step_control();
    for (const std::string& sentence : rig_.control().take_news()) hooks_.log(sentence);
    if (busy) {
      control_bell_.worked();
      keeper_bell_.ring();
      takes_bell_.ring();
      read_bell_.ring();
      capture_bell_.ring();
      encode_bell_.ring();
    } else {
      hal::WakeUps wake_ups;
      rig_.control().add_wake_ups(wake_ups);
      control_bell_.wait(heard, wake_ups);
    }
  }
}

}  // namespace nodal::daemon
