// A rig that sends other bytes of a take than its manifest says, to a host that renders the take from the rig's disk.
#include <gtest/gtest.h>

#include <csignal>
#include <fstream>
#include <functional>

#include "lying_rig.h"
#include "rig_process.h"

namespace nodal::command_line {
namespace {

constexpr StreamId kTakeStream = 2;  // the first stream that a rig opens

/// Serves the files of a folder, each changed by `change`.
class TakeServer final : public LyingRig {
 public:
  TakeServer(const std::string& socket, std::function<std::string(const std::string&)> file)
      : LyingRig(socket), file_(std::move(file)) {}
  std::function<void(const std::string& name, std::string& bytes)> change;
  std::size_t empty_pieces = 0;  ///< sent instead of the bytes

 private:
  void on(const wire::Request& request) override {
    if (!request.has_take_read()) return;
    const std::string& name = request.take_read().file();
    std::string bytes = file_(name);
    if (change) change(name, bytes);
    wire::Reply started;
    const StreamId stream = kTakeStream + 2 * opened_++;
    started.mutable_pull()->set_stream(stream);
    open_stream(stream, StreamPolicy::kLossless);
    reply(request, started);
    constexpr std::size_t kPiece = 60'000;  // with its frame below a frame's limit
    std::uint64_t item = 0;
    for (std::size_t at = request.take_read().offset(); at < bytes.size() && empty_pieces == 0; at += kPiece)
      send(stream, item++, at, bytes.substr(at, kPiece), bytes.size());
    for (std::size_t k = 0; k < empty_pieces; ++k) send(stream, item++, 0, "", bytes.size());
    wire::StreamClose close;
    close.set_offered(item);
    if (empty_pieces == 0) frame(FrameType::kStreamClose, stream, close.SerializeAsString());
  }
  void send(StreamId stream, std::uint64_t item, std::uint64_t at, const std::string& bytes, std::size_t file_bytes) {
    wire::TakePiece piece;
    piece.set_offset(at);
    piece.set_file_bytes(file_bytes);
    first_piece(stream, item, piece.SerializeAsString(), bytes.size(), bytes);
  }

  const std::function<std::string(const std::string&)> file_;
  StreamId opened_ = 0;
};

class LyingTakes : public RigTest {
 protected:
  void SetUp() override {
    const std::string toml = read("rig.toml");
    write("rig.toml", toml + "[takes]\nfolder = \"takes\"\nbuffer_mb = 16\n");
    start_nodald();
    bring_up();
    ASSERT_EQ(nodal({"take", "still"}).code, 0);
    nodald().signal(SIGTERM);
    ASSERT_EQ(nodald().wait().code, 0);
    server_.emplace(path("nodal.sock"), [this](const std::string& name) { return read("takes/000001/" + name); });
  }
  /// With little address space.
  Finished render() {
    Process process(
        {"sh", "-c", "ulimit -v 600000; exec " NODAL_BIN_DIR "/nodal --timeout 10s render 1 -o " + path("r-%d.raw")},
        environment_);
    const std::string stat = "/proc/" + std::to_string(process.pid()) + "/stat";
    (void)wait_until([&] {
      server_->step();
      process.said();
      std::ifstream file(stat);
      const std::string line(std::istreambuf_iterator<char>(file), {});
      return line.find(") Z ") != std::string::npos;
    });
    return process.wait(std::chrono::seconds(1));
  }
  std::optional<TakeServer> server_;
};

TEST_F(LyingTakes, AsItIs_IsRendered) {
  const Finished run = render();
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_FALSE(read("r-1.raw").empty() && read("r-0.raw").empty());
}

TEST_F(LyingTakes, APictureFileLongerThanTheManifestSays_IsRefused) {
  server_->change = [](const std::string& name, std::string& bytes) {
    if (name.ends_with(".mkv")) bytes.append(50'000'000, 'x');
  };
  const Finished run = render();
  EXPECT_EQ(run.code, 3) << run.err;
  EXPECT_NE(run.err.find("the rig sends more than the manifest says"), std::string::npos) << run.err;
}

TEST_F(LyingTakes, APictureFileShorterThanTheManifestSays_IsRefused) {
  server_->change = [](const std::string& name, std::string& bytes) {
    if (name == "cam2-0000.mkv") bytes.resize(700);
  };
  const Finished run = render();
  EXPECT_NE(run.code, 0);
  EXPECT_NE(run.err.find("cam2-0000.mkv: ends at byte 700"), std::string::npos) << run.err;
}

TEST_F(LyingTakes, ManifestWithoutEnd_IsRefused) {
  server_->change = [](const std::string& name, std::string& bytes) {
    if (name == "manifest") bytes.append(40'000'000, ' ');
  };
  const Finished run = render();
  EXPECT_NE(run.code, 0);
  EXPECT_FALSE(run.err.empty());
}

TEST_F(LyingTakes, PiecesOfNothing_AreRefused) {
  server_->empty_pieces = 3;
  const Finished run = render();
  EXPECT_EQ(run.code, 3) << run.err;
  EXPECT_NE(run.err.find("a piece of manifest without bytes"), std::string::npos) << run.err;
}

}  // namespace
}  // namespace nodal::command_line
