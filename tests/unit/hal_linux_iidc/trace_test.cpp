// A trace of an IIDC camera shows its registers by the specification's names, and its frames.
#include <mutex>

#include "hal/linux/iidc/registers.h"
#include "hal/linux/iidc/traced_bus.h"
#include "head_fixture.h"

namespace nodal::hal::iidc {
namespace {

class IidcTrace : public IidcHeadTest {
 protected:
  IidcTrace() { enumerator_ = std::make_unique<IidcEnumerator>(clock_, traced_); }
  ~IidcTrace() override { enumerator_.reset(); }

  std::string all() {
    const std::lock_guard lock(mutex_);
    return text_;
  }
  bool has(const std::string& part) { return all().find(part) != std::string::npos; }

 private:
  std::mutex mutex_;
  std::string text_;

 protected:
  TracedBus traced_{bus_, clock_, [this](const std::string& line) {
                      const std::lock_guard lock(mutex_);
                      text_ += line + "\n";
                    }};
};

TEST_F(IidcTrace, CameraThatStreams_IsTheSameAndItsRegistersAreNamed) {
  auto head = streaming();
  const auto frame = next(*head);
  ASSERT_TRUE(frame) << frame.error().text();
  EXPECT_TRUE(has("iidc:00b09d0100c0ffee: open\n")) << all();
  EXPECT_TRUE(has("iidc:00b09d0100c0ffee: write ISO_EN = 80000000h\n")) << all();
  EXPECT_TRUE(has(": read V_FORMAT_INQ -> ")) << all();
  EXPECT_TRUE(has(": read SHUTTER_INQ -> ")) << all();
  EXPECT_TRUE(has(": frame in buffer 0, ")) << all();
}

TEST_F(IidcTrace, CameraThatFallsSilent_HasALineASecond) {
  auto head = streaming();
  ASSERT_TRUE(next(*head));
  bus_.fall_silent(true);
  for (int i = 0; i < 30; ++i) {
    pass(Duration::milliseconds(100));
    (void)head->take_frame();
  }
  EXPECT_TRUE(has(": no frame for ")) << all();
}

// From tables 4-3, 4-4, 4-8 and 4-9 of IIDC 1.31.
TEST(IidcRegisterNames, AreThoseOfTheSpecification) {
  constexpr std::uint64_t kBase = 0xF00000;
  EXPECT_EQ(register_name(kBase + 0x604, kBase), "CUR_V_MODE");
  EXPECT_EQ(register_name(kBase + 0x81C, kBase), "SHUTTER");
  EXPECT_EQ(register_name(kBase + 0x520, kBase), "GAIN_INQ");
  EXPECT_EQ(register_name(kBase + 0x830, kBase), "TRIGGER_MODE");
  EXPECT_EQ(register_name(kBase + 0x184, kBase), "V_MODE_INQ_1");
  EXPECT_EQ(register_name(kBase + 0x224, kBase), "V_RATE_INQ_1_1");
  EXPECT_EQ(register_name(kBase + 0x2E4, kBase), "V_CSR_INQ_7_1");
  EXPECT_EQ(register_name(0x40010C, kBase), "40010Ch");
}

}  // namespace
}  // namespace nodal::hal::iidc
