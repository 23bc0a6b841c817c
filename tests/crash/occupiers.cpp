#include "occupiers.h"

#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "hal/linux/link/socket_link.h"
#include "protocol/upload.h"
#include "tests/sim/line.h"

namespace nodal::crash {
namespace {

using swarm::Line;

constexpr std::array<std::string_view, kOccupations> kNames{"nothing",
                                                            "status",
                                                            "heads",
                                                            "genlock, shown",
                                                            "exposure, shown",
                                                            "hosts",
                                                            "devices",
                                                            "calibration_list",
                                                            "take_list",
                                                            "audit_log",
                                                            "pull, read",
                                                            "pull, not read",
                                                            "frame_set, read",
                                                            "frame_set, not read",
                                                            "frame_set, view-only, not read",
                                                            "take_read, read",
                                                            "take_read, not read",
                                                            "upload_commit, slow to compile",
                                                            "calibration_use",
                                                            "disk_test of a minute",
                                                            "head_set",
                                                            "take_mark, refused",
                                                            "take_protect"};

constexpr std::uint64_t kMinuteNs = 60'000'000'000;

bool reads(Occupation kind) {
  return kind != Occupation::kFrameSetsUnread && kind != Occupation::kPullsUnread &&
         kind != Occupation::kFrameSetsViewOnly && kind != Occupation::kTakeReadsUnread;
}

/// One host with one request at a time. It connects anew when the rig has closed it.
class Occupier {
 public:
  Occupier(Occupation kind, const Occupiers::Target& target, std::uint64_t number)
      : kind_(kind), target_(target), number_(number) {}

  void act() {
    if (!line_ || line_->dead()) begin();
    if (!line_) return;
    if (!stuck_) {
      while (auto event = line_->take()) handle(*event);
    }
    if (!waits_ && !stuck_) ask();
    line_->write();
  }

 private:
  void begin() {
    const std::string& socket = kind_ == Occupation::kFrameSetsViewOnly ? target_.view : target_.control;
    auto link = hal::connect_link("unix:" + socket);
    line_ = link ? std::make_unique<Line>(std::move(*link), "an occupier") : nullptr;
    waits_ = stuck_ = false;
    uploading_.reset();
  }

  void handle(const Event& event) {
    if (const auto* reply = std::get_if<wire::Reply>(&event)) {
      waits_ = false;
      if (reply->has_upload()) send_document(reply->upload().offset());
      else if (reply->has_pull()) {
        waits_ = reads(kind_);
        stuck_ = !reads(kind_);
      }
    } else if (std::holds_alternative<StreamClosed>(event)) {
      waits_ = false;
    }
  }

  void ask() {
    wire::Request request;
    switch (kind_) {
      case Occupation::kNothing: return;
      case Occupation::kStatus: request.mutable_status(); break;
      case Occupation::kHeads: request.mutable_heads(); break;
      case Occupation::kGenlock: request.mutable_genlock(); break;
      case Occupation::kExposure: request.mutable_exposure(); break;
      case Occupation::kHosts: request.mutable_hosts(); break;
      case Occupation::kDevices: request.mutable_devices(); break;
      case Occupation::kPulls:
      case Occupation::kPullsUnread: request.mutable_pull(); break;
      case Occupation::kCalibrationList: request.mutable_calibration_list(); break;
      case Occupation::kTakeList: request.mutable_take_list(); break;
      case Occupation::kAuditLog: request.mutable_audit_log(); break;
      case Occupation::kFrameSets:
      case Occupation::kFrameSetsUnread:
      case Occupation::kFrameSetsViewOnly: request.mutable_frame_set(); break;
      case Occupation::kTakeReads:
      case Occupation::kTakeReadsUnread:
        request.mutable_take_read()->set_take(1);
        request.mutable_take_read()->set_file("cam0-0000.mkv");
        break;
      case Occupation::kUploads:
        if (uploading_) {
          if (line_->session().counts(*uploading_)) return;  // a commit would overtake the document
          uploading_.reset();
          *request.mutable_upload_commit() = sender_->commit();
        } else {
          // Another name each time, so that nothing is in force or stored already.
          std::string document = target_.slow;
          const std::string name = "slow " + std::to_string(number_) + " " + std::to_string(++documents_);
          document.replace(document.find("slow 0 0"), 8, name);
          sender_.emplace(std::make_shared<const std::vector<std::uint8_t>>(document.begin(), document.end()));
          *request.mutable_upload_begin() = sender_->begin();
        }
        break;
      case Occupation::kCalibrationUse: request.mutable_calibration_rollback(); break;
      case Occupation::kDiskTests: request.mutable_disk_test()->set_length_ns(kMinuteNs); break;
      case Occupation::kSettings:
        request.mutable_head_set()->set_exposure_ns(1'000'000 + number_ * 1000 + asked_ % 1000);
        break;
      case Occupation::kTakeMarks: request.mutable_take_mark()->set_text("a mark"); break;
      case Occupation::kTakeProtects:
        request.mutable_take_protect()->set_take(1);
        request.mutable_take_protect()->set_on(true);
    }
    request.set_id(++asked_);
    waits_ = line_->session().send(request).has_value();
  }

  void send_document(std::uint64_t offset) {
    const auto stream = line_->session().open_stream(StreamPolicy::kLossless);
    if (!stream) return;
    (void)line_->session().offer(*stream, *sender_->item(offset));
    line_->session().close_stream(*stream);
    uploading_ = *stream;
  }

  const Occupation kind_;
  const Occupiers::Target& target_;
  const std::uint64_t number_;
  std::unique_ptr<Line> line_;
  bool waits_ = false;  ///< it waits for an answer, or for the end of a stream
  bool stuck_ = false;  ///< it reads nothing any more
  std::uint64_t asked_ = 0, documents_ = 0;
  std::optional<UploadSender> sender_;
  std::optional<StreamId> uploading_;
};

[[noreturn]] void occupy_for_ever(Occupation kind, int hosts, const Occupiers::Target& target) {
  std::vector<std::unique_ptr<Occupier>> all;
  for (int i = 0; i < hosts; ++i)
    all.push_back(std::make_unique<Occupier>(kind, target, static_cast<std::uint64_t>(i)));
  for (;;) {
    for (const auto& each : all) each->act();
    ::poll(nullptr, 0, 2);
  }
}

}  // namespace

std::string_view name_of(Occupation kind) { return kNames[static_cast<std::size_t>(kind)]; }

Occupiers::Occupiers(Occupation kind, int hosts, const Target& target) : pid_(::fork()) {
  if (pid_ != 0) return;
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  ::signal(SIGPIPE, SIG_IGN);
  ::setpriority(PRIO_PROCESS, 0, 19);
  occupy_for_ever(kind, hosts, target);
}

Occupiers::~Occupiers() {
  if (pid_ <= 0) return;
  ::kill(pid_, SIGKILL);
  ::waitpid(pid_, nullptr, 0);
}

bool Occupiers::running() { return pid_ > 0 && ::waitpid(pid_, nullptr, WNOHANG) == 0; }

}  // namespace nodal::crash
