// The stage that turns an uploaded document into the calibration in force.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "firmware/calibration/calibration_store.h"
#include "firmware/calibration/table_job.h"
#include "firmware/calibration/trial.h"
#include "firmware/config/config.h"
#include "firmware/frame/frame_set.h"
#include "firmware/frame/installed_calibration.h"
#include "firmware/frame/snapshot.h"
#include "hal/disk.h"
#include "protocol/base/result.h"
#include "protocol/base/spsc_ring.h"
#include "protocol/calibration.h"

namespace nodal::firmware {

struct KeeperRequest {
  struct Install {  ///< a document to store and put in force
    std::string json;
    std::optional<Duration> trial{};  ///< for so long at most, and without storing it
    std::string signature{};          ///< of json; empty: none
  };
  struct EndTrial {
    std::string id_prefix;  ///< empty: whatever is on trial
    bool keep = false;
  };
  struct Use {
    std::string id_prefix;
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
};
using CalibrationCommand = KeeperRequest::What;

struct KeeperAnswer {
  struct Done {
    std::optional<Sha256> in_force;  ///< by now
  };
  struct Listed {
    std::vector<CalibrationStore::Entry> entries;
    std::optional<Sha256> in_force;
    std::optional<CalibrationStore::Entry> on_trial;  ///< not among the entries
  };
  struct Document {
    Sha256 id{};
    std::string json;
  };

  std::uint64_t ticket = 0;
  Result<std::variant<Done, Listed, Document>> result;
};

/// The keeper as status tells of it.
struct KeeperReport {
  bool ready = false;              ///< what was in force before the start runs again, or there was nothing
  std::optional<Sha256> in_force;  ///< what the blend runs
  std::string name;                ///< of it
  std::optional<Trial> trial;      ///< of it, when it is on trial
  std::string activity;            ///< "compiling the table of calibration 0123456789ab: 40 %"; empty when idle
  std::string problem;             ///< what stays wrong until somebody acts
};

/// The calibration's heads in the rig's order, or which head does not fit: kHeadMismatch, naming it.
Result<Calibration> fit_to_rig(const Calibration& calibration, const std::vector<HeadConfig>& rig,
                               const HeadShapes& heads);

/// Parse, fit to the rig, store, compile, prove, put in force on the disk, swap; one request at a time, in slices. A
/// request that fails at any of these leaves the old calibration in force, on the disk and in the blend.
///
/// A trial goes the same way but for the disk, on which the old one stays in force: whatever ends the trial without a
/// word to keep it (its time, a power cut, nodald killed) ends with the old one. Its table stays in memory meanwhile, so
/// that the way back compiles nothing and cannot fail. While it lasts, no other calibration is taken.
///
/// Threading: step() is thread-bound to the keeper and takes as long as the disk does, so it has a thread of its own
///   in the field. requests() and answers() are SPSC rings with control, tables_out and tables_back with the blend.
/// Ownership: the disk outlives it.
/// Errors: in the answers, and in the report's problem.
class CalibrationKeeper {
 public:
  CalibrationKeeper(const RigConfig& config, hal::DiskPort& disk, SpscRing<InstalledPtr>& tables_out,
                    SpscRing<InstalledPtr>& tables_back);

  /// True when it did something.
  bool step(Instant now);

  SpscRing<KeeperRequest>& requests() { return requests_; }
  SpscRing<KeeperAnswer>& answers() { return answers_; }
  /// Of the newest step; read by control.
  Snapshot<KeeperReport>& snapshot() { return snapshot_; }
  const KeeperReport& report() const { return report_; }

  static constexpr int kRowsAStep = 2;  ///< of tiles

 private:
  /// A calibration on its way into force.
  struct Installation {
    std::optional<std::uint64_t> ticket;  ///< nothing: at start, nobody waits
    Calibration calibration;
    Sha256 id{};
    bool newly_stored = false;
    std::optional<TableJob> job;  ///< nothing: goes back to what is at hand
    bool on_trial = false;
    bool handed_over = false;  ///< to the blend, which takes it between two sets
  };
  using Answered = std::variant<KeeperAnswer::Done, KeeperAnswer::Listed, KeeperAnswer::Document>;

  void load_at_start();
  void start_next_good();
  bool take_request();
  Status start(const KeeperRequest& request);
  bool answer_at_once(const KeeperRequest& request);
  Status install(const KeeperRequest& request);
  Status install_on_trial(const KeeperRequest& request, Calibration calibration, std::optional<SignedDocument> original,
                          Duration trial);
  Status use(const KeeperRequest& request, const Sha256& id);
  Status end_trial(const KeeperRequest& request, const KeeperRequest::EndTrial& how);
  bool watch_trial();
  void go_back(std::optional<std::uint64_t> ticket);
  void hand_over(InstalledPtr installed);
  Status begin(std::optional<std::uint64_t> ticket, Calibration calibration, const Sha256& id, bool newly_stored,
               const HeadShapes& heads);
  bool compile_some();
  bool compile_within_memory();
  Status put_in_force(Installation& done);
  void end(const Status& status);
  Result<KeeperAnswer::Listed> list() const;
  Result<KeeperAnswer::Document> get(const std::string& id_prefix) const;
  void answer(std::uint64_t ticket, Result<Answered> result);
  void publish();

  const RigConfig config_;
  hal::DiskPort& disk_;
  SpscRing<InstalledPtr>& tables_out_;
  SpscRing<InstalledPtr>& tables_back_;
  SpscRing<KeeperRequest> requests_;
  SpscRing<KeeperAnswer> answers_;
  Snapshot<KeeperReport> snapshot_;
  KeeperReport report_;

  std::optional<CalibrationStore> store_;
  Status store_status_;
  bool started_ = false;
  std::vector<CalibrationStore::Entry> to_try_;  ///< at start, the next to try last
  std::optional<Installation> installing_;
  CalibrationTrial trial_;
  InstalledPtr running_;                  ///< what the blend has, or takes next
  Instant now_;                           ///< of the step under way
  std::optional<KeeperRequest> waiting_;  ///< for the installation under way
};

}  // namespace nodal::firmware
