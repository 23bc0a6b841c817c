#include "firmware/daemon/threads.h"

#include <pthread.h>

#include <chrono>
#include <utility>

#include "firmware/daemon/memory.h"

namespace nodal::daemon {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

constexpr microseconds kPollDevices{500};       ///< the longest delay of a frame
constexpr microseconds kPollSockets{1000};      ///< with hosts connected
constexpr microseconds kPollListeners{10'000};  ///< without hosts
constexpr microseconds kSleep{100'000};         ///< timeout of threads that a bell wakes

}  // namespace

RigThreads::RigThreads(firmware::Rig& rig, int blend_threads, Hooks hooks) : rig_(rig), hooks_(std::move(hooks)) {
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
  add("nodal-capture", &RigThreads::capture);
}

void RigThreads::stop() {
  stop_.store(true);
  for (Bell* bell : {&capture_bell_, &blend_bell_, &encode_bell_, &keeper_bell_, &control_bell_}) bell->ring();
  for (Named& each : threads_) {
    hooks_.waits_for(each.name);
    each.thread.join();
  }
}

bool RigThreads::frame_path_empty() const {
  firmware::Blender& blender = rig_.blender();
  return blender.sets_in().empty() && blender.idle() && blender.counts().blended.load() == rig_.encoder().steps();
}

void RigThreads::capture() {
  while (!stop_.load()) {
    const auto heard = capture_bell_.count();
    if (rig_.step_capture()) {
      blend_bell_.ring();
      control_bell_.ring();  // for changes of heads and answers to commands
    } else if (hooks_.idle_capture && frame_path_empty()) {
      hooks_.idle_capture();
    } else {
      capture_bell_.wait(heard, kPollDevices);
    }
  }
}

void RigThreads::blend() {
  while (!stop_.load()) {
    const auto heard = blend_bell_.count();
    if (!rig_.step_blend()) {
      blend_bell_.wait(heard, kSleep);
      continue;
    }
    blend_bell_.ring();
    encode_bell_.ring();
    keeper_bell_.ring();
  }
}

void RigThreads::encode() {
  while (!stop_.load()) {
    const auto heard = encode_bell_.count();
    if (rig_.step_encode()) {
      control_bell_.ring();
      blend_bell_.ring();  // the blend may wait for room in the encoder's ring
    } else {
      encode_bell_.wait(heard, kSleep);
    }
  }
}

void RigThreads::keep() {
  std::uint64_t adopted = 0;
  while (!stop_.load()) {
    const auto heard = keeper_bell_.count();
    if (rig_.step_keeper()) {
      blend_bell_.ring();
      control_bell_.ring();
    } else {
      const std::uint64_t now = rig_.blender().counts().adopted.load();
      if (std::exchange(adopted, now) != now) give_back_memory();  // a new table is in force, and the old one is freed
      keeper_bell_.wait(heard, kSleep);
    }
  }
}

void RigThreads::control() {
  while (!stop_.load()) {
    const auto heard = control_bell_.count();
    const bool busy = rig_.step_control();
    for (const std::string& sentence : rig_.control().take_news()) hooks_.log(sentence);
    if (busy) {
      keeper_bell_.ring();
      capture_bell_.ring();
      encode_bell_.ring();
    } else {
      control_bell_.wait(heard, rig_.control().clients() > 0 ? kPollSockets : kPollListeners);
    }
  }
}

}  // namespace nodal::daemon
