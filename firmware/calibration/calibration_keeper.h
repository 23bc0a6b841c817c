// The stage that installs calibrations: parses, stores, compiles and puts them in force.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "firmware/calibration/calibration_store.h"
#include "firmware/calibration/permitted_store.h"
#include "firmware/calibration/table_handover.h"
#include "firmware/calibration/trial.h"
#include "firmware/config/config.h"
#include "firmware/frame/frame_set.h"
#include "firmware/frame/presence.h"
#include "firmware/frame/snapshot.h"
#include "hal/confined.h"
#include "hal/disk.h"
#include "protocol/base/result.h"
#include "protocol/base/spsc_ring.h"
#include "protocol/calibration.h"
#include "stitch/sets/blend_plan.h"
#include "stitch/sets/plan_job.h"

namespace nodal::firmware {

struct CalibrationRequest {
  struct Install {  ///< a document to store and put in force
    std::string json;
    std::optional<Duration> trial{};  ///< longest duration of a trial, which is not stored; empty: not a trial
    std::string signature{};          ///< signature of `json`; empty: not signed
    bool allow_older = false;         ///< a signature of an older generation, or without one, is accepted, too
  };
  struct EndTrial {
    std::string id_prefix;  ///< empty: any calibration on trial
    bool keep = false;
  };
  struct Use {
    std::string id_prefix;
    bool allow_older = false;  ///< a signature of an older generation, or without one, is accepted, too
  };
  struct Rollback {};
  struct List {};
  struct Get {
    std::string id_prefix;  ///< empty: the one in force
  };
  using What = std::variant<List, Get, Install, Use, Rollback, EndTrial>;

  std::uint64_t ticket = 0;
  What what;
  HeadShapes heads;
  Presence host{};
};
using CalibrationCommand = CalibrationRequest::What;

struct CalibrationAnswer {
  struct Done {
    std::optional<Sha256> in_force;  ///< after the request
  };
  struct Listed {
    std::vector<CalibrationStore::Entry> entries;
    std::optional<Sha256> in_force;
    std::optional<CalibrationStore::Entry> on_trial;  ///< not one of `entries`
    std::optional<std::uint64_t> signed_generation;   ///< the highest one; empty: no signatures are required
  };
  struct Document {
    Sha256 id{};
    std::string json;
  };

  std::uint64_t ticket = 0;
  Result<std::variant<Done, Listed, Document>> result;
};

/// Status of the stage.
struct KeeperReport {
  bool ready = false;              ///< the start is over: the stored calibration is in force again, or there is none
  std::optional<Sha256> in_force;  ///< the calibration that the blend uses
  std::string name;                ///< its name
  std::shared_ptr<const std::string> document;  ///< its canonical form
  std::optional<Trial> trial;                   ///< has a value while it is on trial
  std::string activity;  ///< "compiling the table of calibration 0123456789ab: 40 %"; empty when idle
  std::string problem;   ///< a fault that stays until an operator acts
};

/// The calibration with its heads in the rig's order. Errors: kHeadMismatch, naming a head that does not fit.
Result<Calibration> fit_to_rig(const Calibration& calibration, const std::vector<HeadConfig>& rig,
                               const HeadShapes& heads);
/// Of every head: what it delivers, or, before it was ever open, what rig.toml says.
std::vector<PixelFormat> delivered_formats(const RigConfig& config, const HeadShapes& heads);

/// Installs a calibration in these steps: parse, fit to the rig, store, compile, validate, put in force on the disk,
/// swap. It works on one change at a time, in slices; control sends the next one when this one is answered. Queries are
/// answered between two slices. A request that fails in any step leaves the old calibration in force.
///
/// A trial takes the same steps except for those on the disk, where the old calibration stays in force. So when a trial
/// ends without a request to keep it (timeout, power cut, nodald killed), the old calibration is in force again. The
/// old table stays in memory during the trial, so that the return compiles nothing and cannot fail. Meanwhile requests
/// to install another calibration are refused.
///
/// Threading: step() is thread-bound to the keeper and blocks on the disk, so it has a thread of its own in nodald.
///   requests() and answers() are SPSC rings with control, tables_out and tables_back with the blend.
/// Ownership: the disk outlives it. Errors: in the answers, and in the report's problem.
class CalibrationKeeper {
 public:
  /// `rehearsal`: where uploaded documents are parsed and compiled first, by rehearse(); null: nowhere.
  CalibrationKeeper(const RigConfig& config, hal::DiskPort& disk, SpscRing<sets::BlendSetup>& tables_out,
                    SpscRing<sets::BlendSetup>& tables_back, hal::ConfinedPort* rehearsal = nullptr);

  /// True when it did something.
  bool step(Instant now);

  SpscRing<CalibrationRequest>& requests() { return requests_; }
  SpscRing<CalibrationAnswer>& answers() { return answers_; }
  /// The report after the newest step; read by control.
  Snapshot<KeeperReport>& snapshot() { return snapshot_; }
  const KeeperReport& report() const { return report_; }

  static constexpr int kRowsAStep = 2;  ///< rows of tiles compiled in one step()

 private:
  /// A calibration that is being installed.
  struct Installation {
    std::optional<std::uint64_t> ticket;  ///< empty: installed without a request, at start or by a timeout
    Sha256 id{};
    bool newly_stored = false;
    std::optional<sets::PlanJob> job;  ///< empty: the plan of this calibration is in memory already
    bool on_trial = false;
    bool handed_over = false;                       ///< it is in tables_; the blend takes it between two sets
    std::shared_ptr<const std::string> document{};  ///< canonical form of the calibration
    std::uint64_t signed_generation = 0;            ///< generation of its signature; 0: none
    std::optional<CalibrationRequest> rehearsed{};  ///< an upload that is parsed and compiled elsewhere first
  };
  using Answered = std::variant<CalibrationAnswer::Done, CalibrationAnswer::Listed, CalibrationAnswer::Document>;

  void load_at_start();
  void start_next_good();
  bool take_requests();
  Status start(const CalibrationRequest& request);
  bool answer_at_once(const CalibrationRequest& request);
  Status rehearse(const CalibrationRequest& request);
  bool end_rehearsal();
  Status install(const CalibrationRequest& request);
  Status end_trial(const CalibrationRequest& request, const CalibrationRequest::EndTrial& how);
  void go_back(std::optional<std::uint64_t> ticket);
  Status begin(std::optional<std::uint64_t> ticket, Calibration calibration, const Sha256& id, bool newly_stored,
               const HeadShapes& heads, std::uint64_t generation = 0);
  bool compile_some();
  Status put_in_force(Installation& done);
  void end(const Status& status);
  void answer(std::uint64_t ticket, Result<Answered> result);

  const RigConfig config_;
  hal::DiskPort& disk_;
  TableHandover tables_;
  SpscRing<CalibrationRequest> requests_;
  SpscRing<CalibrationAnswer> answers_;
  Snapshot<KeeperReport> snapshot_;
  KeeperReport report_;

  hal::ConfinedPort* const rehearsal_;
  PermittedStore store_;
  bool started_ = false;
  std::vector<CalibrationStore::Entry> to_try_;  ///< candidates at start; the next one is at the back
  std::optional<Installation> installing_;
  CalibrationTrial trial_;
  std::shared_ptr<const std::string> document_before_trial_;
  Instant now_;                                ///< time of the current step
  std::optional<CalibrationRequest> waiting_;  ///< a change that waits until the current installation has ended
};

}  // namespace nodal::firmware
