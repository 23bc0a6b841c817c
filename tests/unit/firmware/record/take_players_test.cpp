// Files of every mode of a take, opened by the players that people have: mkvinfo and mkvmerge, mpv, VLC.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "firmware/record/head_coder.h"
#include "protocol/take/documents.h"
#include "protocol/take/matroska_writer.h"
#include "stitch/media/ut_video.h"
#include "tests/support/pictures.h"
#include "tests/support/process.h"

namespace nodal::firmware {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<std::uint8_t>;
using Command = std::vector<std::string>;

constexpr int kWide = 128, kHigh = 96, kFrames = 6;

struct Mode {
  const char* name;
  PixelFormat format;
  Fields fields;
  TakeMode stored;
  bool in_vlc = true;
};
void PrintTo(const Mode& mode, std::ostream* out) { *out << mode.name; }

/// A ramp in every plane, which moves.
Bytes ramp(PixelFormat format, int frame) {
  Bytes bytes(packed_size(format, kWide, kHigh));
  for (std::size_t k = 0; k < bytes.size(); ++k)
    bytes[k] = static_cast<std::uint8_t>(k / kWide + k % kWide + 5U * frame);
  return bytes;
}

/// A finished file, as a take has it.
Bytes film(const Mode& mode) {
  take::VideoTrack track;
  track.codec = "V_UNCOMPRESSED";
  if (mode.stored == TakeMode::kDriver) track.fourcc = take::fourcc_of(mode.format);
  if (mode.stored == TakeMode::kJpeg) track.codec = "V_MJPEG";
  if (mode.stored == TakeMode::kLossless) {
    track.codec = media::kUtVideoCodec;
    track.codec_private = media::ut_video_private(mode.format, kWide, kHigh, {}, mode.fields);
  }
  track.width = kWide;
  track.height = kHigh;
  track.rate = FrameRate{30, 1};
  track.fields = mode.fields;
  track.fields_apart = mode.stored == TakeMode::kJpeg;
  track.attachments = {{take::kCalibrationFile, "application/json", "{\"heads\": []}"}};
  take::MatroskaWriter writer(track);
  Bytes file = writer.head();
  std::optional<HeadCoder> coder;
  const take::Stream delivered{mode.format, kWide, kHigh, {}, mode.fields};
  if (mode.stored != TakeMode::kDriver)
    coder.emplace(delivered, stored_stream(delivered, mode.stored, PixelFormat::kI420));
  for (int k = 0; k < kFrames; ++k) {
    Bytes packet = ramp(mode.format, k);
    if (coder) {
      const auto parts = coder->code(packed_image(mode.format, kWide, kHigh, std::as_const(packet).data()), 90);
      if (!parts) throw std::runtime_error(parts.error().text());
      Bytes both((*parts)[0].begin(), (*parts)[0].end());
      both.insert(both.end(), (*parts)[1].begin(), (*parts)[1].end());
      packet = both;
    }
    const take::Block block{Duration::microseconds(33'333) * k, packet};
    for (const auto& piece : writer.cluster(std::span(&block, 1)).pieces)
      file.insert(file.end(), piece.begin(), piece.end());
  }
  const Bytes end = writer.end();
  file.insert(file.end(), end.begin(), end.end());
  const auto sector = writer.sector();
  std::ranges::copy(sector, file.begin() + take::MatroskaWriter::kSectorAt);
  return file;
}

bool installed(const std::string& program) {
  return test::Process({"sh", "-c", "command -v " + program}).wait().code == 0;
}

std::size_t files_in(const fs::path& folder) {
  return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

class TakePlayers : public testing::TestWithParam<Mode> {
 protected:
  void SetUp() override {
    test::write_bytes(file_, film(GetParam()));
    fs::permissions(folder_.path(), fs::perms::all);
    fs::create_directory(folder_ / "pictures");
    fs::permissions(folder_ / "pictures", fs::perms::all);
  }
  test::TemporaryFolder folder_;
  const fs::path file_ = folder_ / "film.mkv";
};

TEST_P(TakePlayers, Mkvtoolnix_ReadsItWithoutAWarning) {
  if (!installed("mkvmerge")) GTEST_SKIP() << "mkvtoolnix is not installed";
  const test::Finished listed = test::Process({"mkvinfo", "--all", file_.string()}).wait();
  EXPECT_EQ(listed.code, 0) << listed.out << listed.err;
  std::size_t blocks = 0;
  for (std::size_t at = 0; (at = listed.out.find("Simple block: ", at)) != std::string::npos; ++at) ++blocks;
  EXPECT_EQ(blocks, kFrames) << listed.out;
  // Its exit status is 1 after a warning.
  const test::Finished copied =
      test::Process({"mkvmerge", "-o", (folder_ / "copy.mkv").string(), file_.string()}).wait();
  EXPECT_EQ(copied.code, 0) << copied.out << copied.err;
}

TEST_P(TakePlayers, Mpv_ShowsEveryFrame) {
  if (!installed("mpv")) GTEST_SKIP() << "mpv is not installed";
  const test::Finished shown =
      test::Process({"mpv", "--no-config", "--ao=null", "--untimed", "--vo=image",
                     "--vo-image-outdir=" + (folder_ / "pictures").string(), "--msg-level=all=warn", file_.string()})
          .wait();
  EXPECT_EQ(shown.code, 0) << shown.out << shown.err;
  EXPECT_EQ(files_in(folder_ / "pictures"), kFrames) << shown.out << shown.err;
}

TEST_P(TakePlayers, Vlc_ShowsIt) {
  if (!GetParam().in_vlc) GTEST_SKIP() << "VLC has no code for this raw format";
  if (!installed("cvlc")) GTEST_SKIP() << "VLC is not installed";
  Command command{"cvlc",
                  "--intf=dummy",
                  "--vout=dummy",
                  "--no-audio",
                  "--play-and-exit",
                  "--video-filter=scene",
                  "--scene-format=png",
                  "--scene-ratio=1",
                  "--scene-path=" + (folder_ / "pictures").string(),
                  file_.string()};
  // It does not run as root.
  if (geteuid() == 0) command.insert(command.begin(), {"setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"});
  const test::Finished shown = test::Process(command, {{"HOME", folder_.path().string()}}).wait();
  if (shown.err.find("Permission denied") != std::string::npos) GTEST_SKIP() << "another user cannot read " << file_;
  EXPECT_EQ(shown.code, 0) << shown.err;
  EXPECT_GE(files_in(folder_ / "pictures"), 1U) << shown.err;
  // Without a screen, a sound card and a desktop it has other complaints.
  for (const char* trouble : {"demux error", "decoder error", "codec not supported", "stream error"})
    EXPECT_EQ(shown.err.find(trouble), std::string::npos) << shown.err;
}

INSTANTIATE_TEST_SUITE_P(
    All, TakePlayers,
    testing::Values(Mode{"grey", PixelFormat::kGrey8, Fields::kProgressive, TakeMode::kDriver},
                    Mode{"i420", PixelFormat::kI420, Fields::kProgressive, TakeMode::kDriver},
                    Mode{"i420_interlaced", PixelFormat::kI420, Fields::kBottomFirst, TakeMode::kDriver},
                    Mode{"nv12", PixelFormat::kNv12, Fields::kProgressive, TakeMode::kDriver},
                    Mode{"yuyv_interlaced", PixelFormat::kYuyv, Fields::kTopFirst, TakeMode::kDriver},
                    Mode{"uyvy_interlaced", PixelFormat::kUyvy, Fields::kTopFirst, TakeMode::kDriver},
                    Mode{"i422", PixelFormat::kI422, Fields::kProgressive, TakeMode::kDriver},
                    Mode{"yuv411", PixelFormat::kYuv411, Fields::kProgressive, TakeMode::kDriver, false},
                    Mode{"rgb24", PixelFormat::kRgb24, Fields::kProgressive, TakeMode::kDriver, false},
                    Mode{"bayer", PixelFormat::kRggb8, Fields::kProgressive, TakeMode::kDriver, false},
                    Mode{"jpeg", PixelFormat::kI420, Fields::kProgressive, TakeMode::kJpeg},
                    Mode{"jpeg_interlaced", PixelFormat::kYuyv, Fields::kTopFirst, TakeMode::kJpeg},
                    Mode{"lossless", PixelFormat::kI420, Fields::kProgressive, TakeMode::kLossless},
                    Mode{"lossless_interlaced", PixelFormat::kYuyv, Fields::kTopFirst, TakeMode::kLossless},
                    Mode{"lossless_rgb", PixelFormat::kRgb24, Fields::kProgressive, TakeMode::kLossless}),
    [](const auto& mode) { return mode.param.name; });

}  // namespace
}  // namespace nodal::firmware
