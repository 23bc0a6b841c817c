#include "hal/replay/deck.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "stitch/media/image_file.h"
#include "stitch/media/picture_folder.h"
#include "tests/support/pictures.h"

namespace nodal::hal::replay {
namespace {

/// A clock that the test advances.
class Clock final : public ClockPort {
 public:
  Instant now() override { return now_; }
  void advance(Duration by) { now_ = now_ + by; }

 private:
  Instant now_ = Instant::from_ns(123'456'789'012);
};

class Playing : public testing::Test {
 protected:
  void flat(const std::string& name, int level, int width = 16, int height = 8) {
    const std::vector<std::uint8_t> pixels(static_cast<std::size_t>(width * height), static_cast<std::uint8_t>(level));
    test::write_bytes(folder_ / name, test::png_of(pixels, width, height, 1));
  }
  DeckOptions options() const {
    DeckOptions options;
    options.pictures = {media::read_image_header, media::read_image, media::jpegs_and_pngs_in};
    options.base = folder_.path();
    options.keep_bytes = 1 << 20;
    return options;
  }
  /// The first pixel of each of the next n frames.
  std::vector<int> levels(HeadPort& head, int n) {
    std::vector<int> all;
    while (static_cast<int>(all.size()) < n) {
      clock_.advance(FrameRate{}.period() / 4);
      while (auto frame = head.take_frame().value()) {
        all.push_back(frame->verdict == FrameVerdict::kGood ? frame->image.planes[0].data[0] : -1);
        head.release(frame->slot);
      }
    }
    return all;
  }

  test::TemporaryFolder folder_;
  Clock clock_;
};

TEST_F(Playing, OneFile_IsAStillThatComesEveryFrame) {
  flat("a.png", 77);
  Deck deck(clock_, options());
  auto head = deck.enumerator().open("replay:a.png").value();
  ASSERT_TRUE(head->start(TriggerMode::kFreeRun));
  EXPECT_EQ(levels(*head, 5), (std::vector<int>{77, 77, 77, 77, 77}));
}

TEST_F(Playing, PatternOrFolder_ComesInOrderOfNamesAndBeginsAgain) {
  flat("f2.png", 20);
  flat("f1.png", 10);
  flat("f3.png", 30);
  test::write_bytes(folder_ / "f9.txt", {'x'});
  for (const std::string path : {"replay:f*.png", "replay:."}) {
    Deck deck(clock_, options());
    auto head = deck.enumerator().open(path);
    ASSERT_TRUE(head) << head.error().text();
    ASSERT_TRUE((*head)->start(TriggerMode::kExternal));
    ASSERT_TRUE(deck.trigger().start({}));
    EXPECT_EQ(levels(**head, 7), (std::vector<int>{10, 20, 30, 10, 20, 30, 10})) << path;
  }
}

TEST_F(Playing, TwoHeadsStartedApart_ShowTheSamePictureAtTheSameTime) {
  for (int i = 0; i < 7; ++i) {
    flat("a" + std::to_string(i) + ".png", 10 * i);
    flat("b" + std::to_string(i) + ".png", 10 * i + 5);
  }
  Deck deck(clock_, options());
  auto a = deck.enumerator().open("replay:a*.png").value();
  auto b = deck.enumerator().open("replay:b*.png").value();
  ASSERT_TRUE(a->start(TriggerMode::kFreeRun));
  levels(*a, 3);
  ASSERT_TRUE(b->start(TriggerMode::kFreeRun));
  for (int i = 0; i < 20; ++i) {
    clock_.advance(FrameRate{}.period());
    const auto from_a = a->take_frame().value();
    const auto from_b = b->take_frame().value();
    ASSERT_EQ(from_a.has_value(), from_b.has_value());
    if (!from_a) continue;
    EXPECT_EQ(from_a->mid_exposure, from_b->mid_exposure);
    EXPECT_EQ(from_a->image.planes[0].data[0] + 5, from_b->image.planes[0].data[0]);
    a->release(from_a->slot);
    b->release(from_b->slot);
  }
}

TEST_F(Playing, FormatWanted_IsWhatComes) {
  test::write_bytes(folder_ / "a.jpg", test::jpeg_of(test::smooth_rgb(16, 8), 16, 8, test::Sampling::k420));
  for (const auto& [wanted, expected] : {std::pair{std::optional<PixelFormat>{}, PixelFormat::kI420},
                                         {std::optional{PixelFormat::kYuyv}, PixelFormat::kYuyv},
                                         {std::optional{PixelFormat::kMjpeg}, PixelFormat::kMjpeg},
                                         {std::optional{PixelFormat::kRgb24}, PixelFormat::kRgb24}}) {
    Deck deck(clock_, options());
    if (wanted) deck.want_format("replay:a.jpg", *wanted);
    auto head = deck.enumerator().open("replay:a.jpg").value();
    EXPECT_EQ(head->format().pixels, expected);
  }
}

TEST_F(Playing, Mjpeg_IsTheFilesBytesAndNeedsJpegs) {
  const auto jpeg = test::jpeg_of(test::smooth_rgb(16, 8), 16, 8, test::Sampling::k422);
  test::write_bytes(folder_ / "a.jpg", jpeg);
  flat("b.png", 10);
  Deck deck(clock_, options());
  for (const char* const path : {"replay:a.jpg", "replay:b.png"}) deck.want_format(path, PixelFormat::kMjpeg);
  auto head = deck.enumerator().open("replay:a.jpg").value();
  ASSERT_TRUE(head->start(TriggerMode::kFreeRun));
  clock_.advance(FrameRate{}.period() * 2);
  const auto frame = head->take_frame().value();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->image.width, 16);
  const std::uint8_t* const bytes = frame->image.planes[0].data;
  EXPECT_EQ(std::vector<std::uint8_t>(bytes, bytes + frame->image.bytes), jpeg);
  const auto png = deck.enumerator().open("replay:b.png");
  ASSERT_FALSE(png);
  EXPECT_NE(png.error().message.find("is no JPEG"), std::string::npos) << png.error().message;
}

TEST_F(Playing, PictureBrokenInTheMiddle_IsACorruptFrameAndThenItGoesOn) {
  flat("a0.png", 10);
  flat("a1.png", 20);
  flat("a2.png", 30);
  Deck deck(clock_, options());
  auto head = deck.enumerator().open("replay:a*.png").value();
  auto bytes = test::read_bytes(folder_ / "a1.png");
  bytes.resize(bytes.size() / 2);
  test::write_bytes(folder_ / "a1.png", bytes);
  ASSERT_TRUE(head->start(TriggerMode::kExternal));
  ASSERT_TRUE(deck.trigger().start({}));
  EXPECT_EQ(levels(*head, 4), (std::vector<int>{10, -1, 30, 10}));
}

TEST_F(Playing, FirstPictureBroken_OpeningFailsAndNamesHeadAndFile) {
  flat("a.png", 10);
  auto bytes = test::read_bytes(folder_ / "a.png");
  bytes.resize(bytes.size() - 20);
  test::write_bytes(folder_ / "a.png", bytes);
  Deck deck(clock_, options());
  const auto head = deck.enumerator().open("replay:a.png");
  ASSERT_FALSE(head);
  EXPECT_EQ(head.error().code, Errc::kTruncated);
  EXPECT_NE(head.error().message.find("a.png"), std::string::npos);
}

TEST_F(Playing, SizesThatDiffer_AreRefusedByName) {
  flat("a0.png", 10);
  flat("a1.png", 10, 18, 8);
  Deck deck(clock_, options());
  const auto head = deck.enumerator().open("replay:a*.png");
  ASSERT_FALSE(head);
  EXPECT_EQ(head.error().code, Errc::kBadValue);
  EXPECT_NE(head.error().message.find("a1.png"), std::string::npos);
}

TEST_F(Playing, OtherFilesInAFolder_AreNamedAndCountedOnce) {
  flat("b1.png", 10);
  flat("b2", 20);  // a picture by its content
  test::write_bytes(folder_ / "a.heic", {0, 0, 0, 24, 'f', 't', 'y', 'p', 'h', 'e', 'i', 'c', 0, 0, 0, 0});
  test::write_bytes(folder_ / "b.heic", {0, 0, 0, 24, 'f', 't', 'y', 'p', 'h', 'e', 'i', 'c', 0, 0, 0, 0});
  test::write_bytes(folder_ / "c", {'I', 'I', 42, 0, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0});
  test::write_bytes(folder_ / ".hidden", {'x'});
  std::vector<std::string> notes;
  DeckOptions with_notes = options();
  with_notes.note = [&](const std::string& sentence) { notes.push_back(sentence); };
  Deck deck(clock_, with_notes);
  for (int time = 0; time < 2; ++time) {
    auto head = deck.enumerator().open("replay:.");
    ASSERT_TRUE(head) << head.error().text();
    ASSERT_TRUE((*head)->start(TriggerMode::kFreeRun));
    std::vector<int> seen = levels(**head, 4);
    std::sort(seen.begin(), seen.end());
    EXPECT_EQ(seen, (std::vector<int>{10, 10, 20, 20}));
  }
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_NE(notes[0].find("2 pictures are read; left out: "), std::string::npos) << notes[0];
  EXPECT_NE(notes[0].find("2 HEIF files (a.heic, b.heic): convert"), std::string::npos) << notes[0];
  EXPECT_NE(notes[0].find("a TIFF (c): convert it to PNG"), std::string::npos) << notes[0];
  EXPECT_EQ(notes[0].find("hidden"), std::string::npos) << notes[0];
}

TEST_F(Playing, AFileInAFolderThatIsOnlyCalledLikeAPicture_IsAnErrorByName) {
  flat("a1.png", 10);
  test::write_bytes(folder_ / "a2.png", {'x', 'y'});
  Deck deck(clock_, options());
  const auto head = deck.enumerator().open("replay:.");
  ASSERT_FALSE(head);
  EXPECT_NE(head.error().message.find("a2.png"), std::string::npos) << head.error().message;
}

TEST_F(Playing, AFolderWithoutAPicture_SaysWhatItHoldsInstead) {
  test::write_bytes(folder_ / "a.heic", {0, 0, 0, 24, 'f', 't', 'y', 'p', 'h', 'e', 'i', 'c', 0, 0, 0, 0});
  Deck deck(clock_, options());
  const auto head = deck.enumerator().open("replay:.");
  ASSERT_FALSE(head);
  EXPECT_EQ(head.error().code, Errc::kNoSuchDevice);
  EXPECT_NE(head.error().message.find("an HEIF file (a.heic)"), std::string::npos) << head.error().message;
}

TEST_F(Playing, NothingThere_IsNoSuchDevice) {
  Deck deck(clock_, options());
  for (const std::string path : {"replay:x.png", "replay:y*.jpg", "sim:cam0"}) {
    const auto head = deck.enumerator().open(path);
    ASSERT_FALSE(head);
    EXPECT_EQ(head.error().code, Errc::kNoSuchDevice) << head.error().text();
  }
}

TEST_F(Playing, ExposureOfAPicture_MayBeSetToItselfOnly) {
  flat("a.png", 10);
  Deck deck(clock_, options());
  auto head = deck.enumerator().open("replay:a.png").value();
  EXPECT_TRUE(head->set_exposure(head->limits().exposure_max));
  EXPECT_TRUE(head->set_gain(head->limits().gain_max));
  EXPECT_EQ(head->set_exposure(Exposure::microseconds(1)).error().code, Errc::kBadValue);
}

}  // namespace
}  // namespace nodal::hal::replay
