// A nodald under observation: the service to good clients, and its resource use.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "protocol/nodal.pb.h"
#include "tests/sim/line.h"
#include "tests/support/process.h"

namespace nodal::crash {

/// The observations of one phase.
struct PhaseReport {
  std::string name;
  double seconds = 0;
  std::uint64_t raymaps = 0;         ///< received by the good puller
  std::uint64_t sets = 0;            ///< made by the rig
  std::string lost;                  ///< lost sets by reason; "none"
  std::vector<double> latencies_ms;  ///< latencies of the good clients' requests, sorted
  std::uint64_t resident_bytes = 0;  ///< maximum
  std::uint64_t descriptors = 0;     ///< maximum
  std::uint64_t log_bytes = 0, settings_bytes = 0;
  std::uint64_t reconnects = 0;  ///< by good clients that the rig had disconnected
  double rate() const { return static_cast<double>(raymaps) / seconds; }
  double log_bytes_a_minute() const { return static_cast<double>(log_bytes) * 60 / seconds; }
  double median_ms() const { return latencies_ms.empty() ? 0 : latencies_ms[latencies_ms.size() / 2]; }
  double worst_ms() const { return latencies_ms.empty() ? 0 : latencies_ms.back(); }
};

/// nodald on a copy of a rig's folder (rig.toml and the calibration named in its [sim]), with three good clients: one
/// pulls the newest JPEG raymaps, one requests the status four times per second, and one connects anew every 5 s. They
/// retry when refused or disconnected; a request's time counts from the first attempt.
///
/// Threading: thread-bound.
/// Ownership: owns the process, and a temporary folder.
/// Errors: start() and watch() return false if nodald does not run or does not answer; why() gives the reason.
class Besieged {
 public:
  explicit Besieged(const std::filesystem::path& rig);
  ~Besieged();
  Besieged(const Besieged&) = delete;
  Besieged& operator=(const Besieged&) = delete;

  /// Starts nodald, uploads the calibration, sets exposures, starts the genlock.
  bool start();
  /// Restores the settings after others changed them.
  bool set_up();
  /// Observes for the given time.
  std::optional<PhaseReport> watch(const std::string& phase, std::chrono::seconds how_long);
  /// Sends SIGTERM; returns the exit code.
  int stop();

  std::string socket() const { return (folder_ / "sock").string(); }
  const std::string& document() const { return document_; }
  const std::string& why() const { return why_; }

 private:
  using Clock = std::chrono::steady_clock;
  /// A client that requests the status and measures the response time.
  struct Asker {
    std::unique_ptr<swarm::Line> line;
    std::chrono::milliseconds every;
    bool newcomer = false;
    Clock::time_point due{};  ///< time of the first attempt
    Clock::time_point next_try{};
    std::optional<std::uint64_t> asked;
  };

  void turn();
  void turn_of(Asker& asker, Clock::time_point now);
  void turn_of_puller(Clock::time_point now);
  std::unique_ptr<swarm::Line> connect() const;
  void sample();

  std::filesystem::path folder_;
  std::string document_, why_;
  std::optional<wire::Genlock> genlock_;  ///< as in rig.toml
  std::optional<test::Process> nodald_;
  Asker steady_, newcomer_;
  std::unique_ptr<swarm::Line> puller_;
  Clock::time_point next_pull_{};
  std::uint64_t next_id_ = 1;
  std::optional<wire::RigStatus> first_status_, status_;
  PhaseReport report_;
};

}  // namespace nodal::crash
