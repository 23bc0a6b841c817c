// The stage that turns an uploaded document into the calibration in force.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "firmware/calibration_store.h"
#include "firmware/config.h"
#include "firmware/raymap.h"
#include "firmware/snapshot.h"
#include "hal/disk.h"
#include "protocol/base/result.h"
#include "protocol/base/spsc_ring.h"
#include "protocol/calibration.h"
#include "stitch/table/table_compiler.h"

namespace nodal::firmware {

/// What a head delivers, as far as is known: nothing while it was never open.
struct HeadShape {
  PixelFormat format = PixelFormat::kI420;
  int width = 0;
  int height = 0;
};
using HeadShapes = std::vector<std::optional<HeadShape>>;

struct KeeperRequest {
  struct Install { std::string json; };             ///< a document to store and put in force
  struct Use { std::string id_prefix; };
  struct Rollback {};
  struct List {};
  struct Get { std::string id_prefix; };            ///< empty: the one in force
  struct Remember { std::string settings; };        ///< to be in report().settings after the next start

  std::uint64_t ticket = 0;
  std::variant<List, Get, Install, Use, Rollback, Remember> what;
  HeadShapes heads;
};

struct KeeperAnswer {
  struct Done {};
  struct Listed {
    std::vector<CalibrationStore::Entry> entries;
    std::optional<Sha256> in_force;
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
  std::string activity;            ///< "compiling the table of calibration 0123456789ab: 40 %"; empty when idle
  std::string problem;             ///< what stays wrong until somebody acts
  std::optional<std::string> settings;  ///< once they were read: what was remembered before the start; empty: nothing
};

/// The calibration's heads in the rig's order, or which head does not fit: kHeadMismatch, naming it.
Result<Calibration> fit_to_rig(const Calibration& calibration, const std::vector<HeadConfig>& rig,
                               const HeadShapes& heads);

/// Parse, fit to the rig, store, compile, prove, put in force on the disk, swap; one request at a time, in slices. A
/// request that fails at any of these leaves the old calibration in force, on the disk and in the blend.
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
  bool step();

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
    std::optional<table::TableCompiler> job;
    int rows_done = 0;
    bool handed_over = false;  ///< to the blend, which takes it between two sets
  };
  using Answered = std::variant<KeeperAnswer::Done, KeeperAnswer::Listed, KeeperAnswer::Document>;

  void load_at_start();
  void read_settings();
  void start_next_good();
  bool take_request();
  Status start(const KeeperRequest& request);
  bool answer_at_once(const KeeperRequest& request);
  Status install(const KeeperRequest& request, const std::string& json);
  Status use(const KeeperRequest& request, const Sha256& id);
  Status begin(std::optional<std::uint64_t> ticket, Calibration calibration, const Sha256& id, bool newly_stored,
               const HeadShapes& heads);
  bool compile_some();
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
  std::optional<KeeperRequest> waiting_;  ///< for the installation under way
};

}  // namespace nodal::firmware
