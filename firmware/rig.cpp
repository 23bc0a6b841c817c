#include "firmware/rig.h"

#include <memory>

#include "firmware/flight/flight_recorder.h"

namespace nodal::firmware {
namespace {

bool records_flight(const RigConfig& config, const RigPorts& ports) {
  return config.takes && config.takes->flight_recorder && ports.takes;
}

}  // namespace

Rig::Rig(const RigConfig& config, const RigPorts& ports, const std::string& software)
    : clock_(ports.clock),
      flight_(records_flight(config, ports) ? std::make_unique<FlightRecorder>(config, ports.heads, ports.trigger)
                                            : nullptr),
      capture_(config, flight_ ? flight_->heads() : ports.heads, flight_ ? flight_->trigger() : ports.trigger),
      blender_(config.raymap, ports.stopwatch ? *ports.stopwatch : ports.clock, capture_.add_outlet(Blender::kSets)),
      places_seams_(config.raymap.seams == SeamPlacement::kPlaced),
      seams_(blender_.seams().requests(), blender_.seams().answers()),
      encoder_(config.raymap, ports.stopwatch ? *ports.stopwatch : ports.clock, blender_.raymaps_out()),
      keeper_(config, ports.disk, blender_.swap().tables_in(), blender_.swap().tables_out(), ports.rehearsal),
      settings_(ports.disk),
      audit_(ports.disk),
      frame_sets_(capture_.add_outlet(FrameSender::kSets, false)),
      takes_(config.takes && ports.takes ? std::make_unique<Takes>(*this, config, ports, software) : nullptr),
      control_(config, software, stages(ports), frame_sets_, ports.listeners, ports.watchdog, ports.panel, ports.scan,
               ports.clock.now()) {
  capture_.meter_from(blender_.light_out());
  if (flight_) capture_.log_to(*flight_);
}

/// The recorder registers its outlets, so this comes before the first step.
Rig::Takes::Takes(Rig& rig, const RigConfig& config, const RigPorts& ports, const std::string& software)
    : recorder(config, rig.capture_.add_outlet(Recorder::kSets, false), rig.encoder_),
      flight_log(rig.flight_ ? std::make_unique<FlightLog>(*rig.flight_, software, kSetsHeld) : nullptr),
      keeper(config, *ports.takes, recorder, software, ports.utc, flight_log.get(),
             rig.places_seams_ ? &rig.blender_.seams().log() : nullptr, ports.recovery),
      reader(*ports.takes_read, recorder, keeper.in_use()) {}

Stages Rig::stages(const RigPorts& ports) {
  Stages stages{capture_, blender_, encoder_, keeper_, settings_, audit_, ports.utc};
  stages.heartbeats = ports.heartbeats;
  if (!takes_) return stages;
  stages.takes = &takes_->keeper;
  stages.take_reader = &takes_->reader;
  return stages;
}

Rig::~Rig() { close(); }

bool Rig::step_capture() { return capture_.step(clock_.now()); }

bool Rig::step_keeper() {
  bool busy = settings_.step();
  busy |= audit_.step(clock_.now());
  return keeper_.step(clock_.now()) || busy;
}

bool Rig::step_control() { return control_.step(clock_.now()); }

bool Rig::step_all() {
  bool busy = step_capture();
  while (step_blend() || step_seams()) busy = true;
  while (step_encode()) busy = true;
  busy |= step_record();
  busy |= step_takes();
  busy |= step_take_reader();
  busy |= step_keeper();
  busy |= step_control();
  return busy;
}

void Rig::close() {
  if (takes_) takes_->keeper.close(clock_.now());
  blender_.close();
  capture_.close();
  settings_.close();
}

}  // namespace nodal::firmware
