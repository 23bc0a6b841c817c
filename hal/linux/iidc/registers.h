// Registers of IIDC cameras: offsets and bits.
//
// Source: IIDC 1394-based Digital Camera Specification, 1.31 (1394 Trade Association, TA Document 2003017). Its bit 0
// is the highest.
#pragma once

#include <cstdint>

namespace nodal::hal::iidc::reg {

constexpr std::uint32_t bit(unsigned number) { return 0x8000'0000U >> number; }

// Offsets from the command registers' base.
inline constexpr std::uint32_t kInitialize = 0x000;
inline constexpr std::uint32_t kFormats = 0x100;        ///< V_FORMAT_INQ
inline constexpr std::uint32_t kModes = 0x180;          ///< V_MODE_INQ, four bytes a format
inline constexpr std::uint32_t kRates = 0x200;          ///< V_RATE_INQ, 32 bytes a format, four a mode
inline constexpr std::uint32_t kFormat7Places = 0x2E0;  ///< V_CSR_INQ_7, four bytes a mode
inline constexpr std::uint32_t kBasicFunctions = 0x400;
inline constexpr std::uint32_t kFeaturesPresent = 0x404;  ///< FEATURE_PRESENCE_INQ, features 0 to 31
inline constexpr std::uint32_t kFeatureInquiries = 0x500;
inline constexpr std::uint32_t kRate = 0x600;  ///< value in the three highest bits, as in the next two registers
inline constexpr std::uint32_t kMode = 0x604;
inline constexpr std::uint32_t kFormat = 0x608;
inline constexpr std::uint32_t kIsoChannel = 0x60C;
inline constexpr std::uint32_t kPower = 0x610;
inline constexpr std::uint32_t kTransmit = 0x614;        ///< ISO_EN
inline constexpr std::uint32_t kModeError = 0x628;       ///< VMODE_ERROR_STATUS
inline constexpr std::uint32_t kAbsolutePlaces = 0x700;  ///< ABS_CSR_HI_INQ
inline constexpr std::uint32_t kFeatures = 0x800;        ///< four bytes a feature, as the inquiries and places
inline constexpr std::uint32_t kTriggerFeature = 12;

// kBasicFunctions
inline constexpr std::uint32_t kHasModeError = bit(1);
inline constexpr std::uint32_t kHasPower = bit(16);

// A feature's inquiry and its register. The lowest 24 bits are two numbers of 12: minimum and maximum, or U/B and V/R
// values.
inline constexpr std::uint32_t kPresent = bit(0);
inline constexpr std::uint32_t kAbsolute = bit(1);
inline constexpr std::uint32_t kOn = bit(6);         ///< bit of the feature's register; its inquiry has bit(5)
inline constexpr std::uint32_t kAutomatic = bit(7);  ///< bit of the feature's register; its inquiry has bit(6)
inline constexpr std::uint32_t kCanSwitch = bit(5);
inline constexpr std::uint32_t kCanAutomatic = bit(6);
inline constexpr std::uint32_t kTwelveBits = 0xFFF;

// The trigger's inquiry and its register.
inline constexpr std::uint32_t kCanPolarity = bit(6);
inline constexpr std::uint32_t kCanMode0 = bit(16), kCanMode1 = bit(17);
inline constexpr std::uint32_t kActiveHigh = bit(7);
inline constexpr unsigned kTriggerModeShift = 16;
inline constexpr std::uint32_t kTriggerModeBits = 0xF'0000;

// Offsets from a feature's absolute registers, which are 32-bit floats.
inline constexpr std::uint32_t kAbsoluteLow = 0x0, kAbsoluteHigh = 0x4, kAbsoluteValue = 0x8;

// Offsets from the registers of a mode of format 7. Sizes and places: width or left in the high half.
inline constexpr std::uint32_t kMaxSize = 0x00;
inline constexpr std::uint32_t kUnitSize = 0x04;
inline constexpr std::uint32_t kPlace = 0x08;
inline constexpr std::uint32_t kSize = 0x0C;
inline constexpr std::uint32_t kCoding = 0x10;        ///< value in the highest byte
inline constexpr std::uint32_t kCodings = 0x14;       ///< bit(coding)
inline constexpr std::uint32_t kPacketLimits = 0x40;  ///< unit and most bytes of a packet
inline constexpr std::uint32_t kPacket = 0x44;  ///< bytes of a packet in the high half, the recommended in the low one
inline constexpr std::uint32_t kPacketsPerFrame = 0x48;
inline constexpr std::uint32_t kUnitPlace = 0x4C;      ///< 0: as kUnitSize
inline constexpr std::uint32_t kFrameInterval = 0x50;  ///< seconds, a float; 0: not known
inline constexpr std::uint32_t kColourFilter = 0x58;   ///< value in the highest byte
inline constexpr std::uint32_t kValueSetting = 0x7C;
inline constexpr std::uint32_t kSetting1 = bit(1), kError1 = bit(8), kError2 = bit(9);

// A maker's own registers (Point Grey Research, Register Reference), from the command registers' base.
inline constexpr std::uint32_t kFrameInfo = 0x12F8;

}  // namespace nodal::hal::iidc::reg
