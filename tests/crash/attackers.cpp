#include "attackers.h"

#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <fstream>
#include <memory>
#include <sstream>
#include <vector>

#include "hal/linux/link/socket_link.h"
#include "protocol/upload.h"
#include "tests/sim/hostile.h"

namespace nodal::crash {
namespace {

using swarm::Hostile;
using swarm::HostileKind;
using swarm::Line;

constexpr int kTurnMs = 10;  ///< every attacker's turn: a flood is 600 requests per second, a storm 150 connections
constexpr int kOfAKind = 2;
constexpr Duration kChangesEvery = Duration::milliseconds(50);
constexpr Duration kUploadsEvery = Duration::seconds(2);

Instant steady_now() {
  return Instant::from_ns(std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1));
}

/// Makes every change that a control client may make, with values within and beyond the limits.
class Changer {
 public:
  Changer(Hostile::Connect connect, std::string document)
      : connect_(std::move(connect)), document_(std::move(document)), random_(7, "changer") {}

  void act(Instant now) {
    if (!line_ || line_->dead()) {
      auto link = connect_(false);
      line_ = link ? std::make_unique<Line>(std::move(link), "changer\n\x1b[2J") : nullptr;
      uploading_.reset();
    }
    if (!line_) return;
    while (line_->take()) {}
    if (now >= next_change_) {
      next_change_ = now + kChangesEvery;
      send(change());
    }
    if (!uploading_ && now >= next_upload_) {
      next_upload_ = now + kUploadsEvery;
      upload();
    }
    commit_when_sent();
    line_->write();
  }

 private:
  void send(wire::Request request) {
    request.set_id(next_id_++);
    (void)line_->session().send(request);
  }

  wire::Request change() {
    wire::Request request;
    constexpr std::array<std::array<std::uint32_t, 2>, 6> kRates = {{{UINT32_MAX, UINT32_MAX},
                                                                     {299'700'300, 10'000'000},
                                                                     {2'997'003, 100'000},
                                                                     {1000, 1},
                                                                     {1, 1000},
                                                                     {30'000, 1001}}};
    wire::GenlockRequest& genlock = *request.mutable_genlock();
    switch (random_.below(8)) {
      case 0:
      case 1: {
        const auto& rate = kRates[random_.below(kRates.size())];
        genlock.set_action(wire::GenlockRequest::START);
        genlock.set_rate_numerator(rate[0]);
        genlock.set_rate_denominator(rate[1]);
        break;
      }
      case 2: genlock.set_action(wire::GenlockRequest::STOP); break;
      case 3: request.mutable_head_set()->set_exposure_ns(random_.chance(500'000) ? 1 : 3'600'000'000'000); break;
      case 4: request.mutable_head_set()->set_gain_mdb(random_.chance(500'000) ? INT32_MIN : INT32_MAX); break;
      case 5: request.mutable_head_set()->set_gamma(random_.chance(500'000) ? 100 : 8000); break;
      case 6: request.mutable_exposure()->set_program(random_.chance(500'000) ? "joint" : "manual"); break;
      default: request.mutable_calibration_rollback(); break;
    }
    return request;
  }

  /// Uploads the calibration in force under a name with line breaks and terminal control characters.
  void upload() {
    std::string document = document_;
    const std::size_t name = document.find("\"name\"");
    const std::size_t value = name == std::string::npos ? name : document.find('"', document.find(':', name));
    if (value == std::string::npos) return;
    document.insert(value + 1, "x\\nnodald: everything is fine\\u001b[31m" + std::to_string(random_.below(100)));
    const auto bytes = std::make_shared<const std::vector<std::uint8_t>>(document.begin(), document.end());
    const UploadSender sender(bytes);
    wire::Request begin;
    *begin.mutable_upload_begin() = sender.begin();
    send(begin);
    const auto stream = line_->session().open_stream(StreamPolicy::kLossless);
    if (!stream) return;
    (void)line_->session().offer(*stream, *sender.item(0));
    line_->session().close_stream(*stream);
    uploading_ = *stream;
    committing_ = sender.commit();
  }

  void commit_when_sent() {
    if (!uploading_ || line_->session().counts(*uploading_)) return;
    wire::Request commit;
    *commit.mutable_upload_commit() = committing_;
    if (random_.chance(500'000)) commit.mutable_upload_commit()->set_trial_ns(1'000'000'000);
    send(commit);
    uploading_.reset();
  }

  const Hostile::Connect connect_;
  const std::string document_;
  hal::sim::Random random_;
  std::unique_ptr<Line> line_;
  std::optional<StreamId> uploading_;
  wire::UploadCommit committing_;
  Instant next_change_, next_upload_;
  std::uint64_t next_id_ = 1;
};

[[noreturn]] void attack_for_ever(Attack attack, const std::string& socket, const std::string& document) {
  const Hostile::Connect connect = [&socket](bool) -> std::unique_ptr<hal::LinkPort> {
    auto link = hal::connect_link("unix:" + socket);
    return link ? std::move(*link) : nullptr;
  };
  std::vector<std::unique_ptr<Hostile>> all;
  for (int kind = 0; attack == Attack::kLoad && kind < swarm::kHostileKinds; ++kind) {
    for (int i = 0; i < kOfAKind; ++i) {
      all.push_back(std::make_unique<Hostile>(static_cast<HostileKind>(kind), connect, document, UINT64_MAX,
                                              static_cast<std::uint64_t>(kind * kOfAKind + i + 1)));
    }
  }
  Changer changer(connect, document);
  for (;;) {
    const Instant now = steady_now();
    for (const auto& each : all) each->act(now);
    if (attack == Attack::kChange) changer.act(now);
    ::poll(nullptr, 0, kTurnMs);
  }
}

}  // namespace

Attackers::Attackers(Attack attack, const std::string& socket, const std::string& document) : pid_(::fork()) {
  if (pid_ != 0) return;
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  ::signal(SIGPIPE, SIG_IGN);
  ::setpriority(PRIO_PROCESS, 0, 19);
  attack_for_ever(attack, socket, document);
}

Attackers::~Attackers() {
  if (pid_ <= 0) return;
  ::kill(pid_, SIGKILL);
  ::waitpid(pid_, nullptr, 0);
}

bool Attackers::running() { return pid_ > 0 && ::waitpid(pid_, nullptr, WNOHANG) == 0; }

double Attackers::cpu_seconds() const {
  std::ifstream stat("/proc/" + std::to_string(pid_) + "/stat");
  std::string text;
  std::getline(stat, text);
  std::istringstream fields(text.substr(std::min(text.size(), text.rfind(')') + 1)));
  std::string skipped;
  double user = 0;
  double system = 0;
  for (int i = 0; i < 11; ++i) fields >> skipped;
  fields >> user >> system;
  return (user + system) / static_cast<double>(::sysconf(_SC_CLK_TCK));
}

}  // namespace nodal::crash
