#include "sim/cameras/gige_cameras.h"
#include "sim/cameras/triggers.h"

namespace v3d::sim {
namespace {

std::string text(const char* tag, const std::string& value) {
  return std::string("<") + tag + ">" + value + "</" + tag + ">";
}

std::string node(const char* type, const std::string& name, const std::string& body) {
  return std::string("<") + type + " Name=\"" + name + "\">" + body + "</" + type + ">\n";
}

std::string category(const std::string& name, std::initializer_list<const char*> features) {
  std::string body;
  for (const char* feature : features) {
    body += text("pFeature", feature);
  }
  return node("Category", name, body);
}

/// A 32-bit big-endian register.
std::string reg(const std::string& name, const std::string& address, const char* access = "RW",
                const char* index = "") {
  return node("IntReg", name,
              text("Address", address) + index + text("Length", "4") + text("AccessMode", access) +
                  text("pPort", "Device") + text("Sign", "Unsigned") +
                  text("Endianess", "BigEndian"));
}

std::string string_reg(const std::string& name, const char* address, const char* length) {
  return node("StringReg", name,
              text("Address", address) + text("Length", length) + text("AccessMode", "RO") +
                  text("pPort", "Device"));
}

std::string integer(const std::string& name, const std::string& address, const char* access,
                    const std::string& limits) {
  return node("Integer", name, text("pValue", name + "Register") + limits) +
         reg(name + "Register", address, access);
}

struct Entry {
  const char* name;
  const char* value;
};
std::string enumeration(const std::string& name, std::initializer_list<Entry> entries,
                        const std::string& address, const char* index = "") {
  std::string body;
  for (const Entry& entry : entries) {
    body += node("EnumEntry", entry.name, text("Value", entry.value));
  }
  return node("Enumeration", name, body + text("pValue", name + "Register")) +
         reg(name + "Register", address, "RW", index);
}

std::string command(const std::string& name, const char* target, const char* value) {
  return node("Command", name, text("pValue", target) + text("CommandValue", value));
}

/// A float feature over an integer register: register = feature * scale.
std::string scaled_float(const std::string& name, const char* address, const std::string& scale,
                         const std::string& limits) {
  return node("Float", name, text("pValue", name + "Converter") + limits) +
         node("Converter", name + "Converter",
              text("FormulaTo", "FROM * " + scale) + text("FormulaFrom", "TO / " + scale) +
                  text("pValue", name + "Register")) +
         reg(name + "Register", address);
}

/// All formats of GenICam cameras that the capture layer knows.
std::string pixel_formats() {
  std::string body;
  for (const CameraFormat format : pfnc_formats()) {
    body += node("EnumEntry", std::string(name(format)),
                 text("Value", std::to_string(*pfnc_code(format))));
  }
  return node("Enumeration", "PixelFormat", body + text("pValue", "PixelFormatRegister")) +
         reg("PixelFormatRegister", "0x128");
}

std::string boolean(const std::string& name, const char* address) {
  return node("Boolean", name,
              text("pValue", name + "Register") + text("OnValue", "1") + text("OffValue", "0")) +
         reg(name + "Register", address);
}

constexpr const char* kBySelector = "<pIndex Offset=\"0x20\">TriggerSelectorValue</pIndex>";
constexpr const char* kByLine = "<pIndex Offset=\"0x4\">LineSelectorRegister</pIndex>";

}  // namespace

std::string genicam_xml() {
  return "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n"
         "<RegisterDescription ModelName=\"SimulatedCamera\" VendorName=\"V3D\" "
         "StandardNameSpace=\"None\" SchemaMajorVersion=\"1\" SchemaMinorVersion=\"1\" "
         "SchemaSubMinorVersion=\"0\" MajorVersion=\"1\" MinorVersion=\"0\" SubMinorVersion=\"0\" "
         "ToolTip=\"Simulated camera\" ProductGuid=\"0\" VersionGuid=\"0\" "
         "xmlns=\"http://www.genicam.org/GenApi/Version_1_1\">\n" +
         category("Root", {"DeviceControl", "ImageFormatControl", "AcquisitionControl",
                           "AnalogControl", "DigitalIOControl", "ActionControl", "UserSetControl",
                           "TransportLayerControl"}) +
         category("DeviceControl",
                  {"DeviceVendorName", "DeviceModelName", "DeviceManufacturerInfo", "DeviceVersion",
                   "DeviceID", "DeviceSerialNumber", "PtpEnable", "PtpStatus", "PtpDataSetLatch",
                   "PtpOffsetFromMaster", "DeviceFirmwareVersion", "DeviceTemperature"}) +
         string_reg("DeviceVendorName", "0x48", "32") +
         string_reg("DeviceModelName", "0x68", "32") + string_reg("DeviceVersion", "0x88", "32") +
         string_reg("DeviceManufacturerInfo", "0xa8", "48") + string_reg("DeviceID", "0xd8", "16") +
         string_reg("DeviceSerialNumber", "0xd8", "16") +
         string_reg("DeviceFirmwareVersion", "0x88", "32") +
         scaled_float("DeviceTemperature", "0x330", "100", "") +

         // PTP: a camera that finds its master at once and follows it, unless it is unlocked.
         node("Boolean", "PtpEnable",
              text("pValue", "PtpEnableRegister") + text("OnValue", "1") + text("OffValue", "0")) +
         reg("PtpEnableRegister", std::to_string(registers::kPtpEnable)) +
         node("Enumeration", "PtpStatus",
              node("EnumEntry", "Disabled", text("Value", "0")) +
                  node("EnumEntry", "Slave", text("Value", "1")) +
                  node("EnumEntry", "Listening", text("Value", "2")) +
                  text("pValue", "PtpStatusValue")) +
         node("IntSwissKnife", "PtpStatusValue",
              "<pVariable Name=\"E\">PtpEnableRegister</pVariable>"
              "<pVariable Name=\"U\">PtpUnlockedRegister</pVariable>"
              "<Formula>E * (1 + U)</Formula>") +
         reg("PtpUnlockedRegister", std::to_string(registers::kPtpUnlocked)) +
         command("PtpDataSetLatch", "PtpLatchRegister", "1") + reg("PtpLatchRegister", "0x314") +
         node("Integer", "PtpOffsetFromMaster", text("pValue", "PtpOffsetRegister")) +
         reg("PtpOffsetRegister", "0x318", "RO") +

         category("ImageFormatControl",
                  {"SensorWidth", "SensorHeight", "OffsetX", "OffsetY", "Width", "Height",
                   "PixelFormat", "BinningHorizontal", "BinningVertical", "ReverseX", "ReverseY"}) +
         // The pictures come from outside, so binning and mirroring have no effect.
         integer("BinningHorizontal", "0x334", "RW", "<Min>1</Min><Max>2</Max>") +
         integer("BinningVertical", "0x338", "RW", "<Min>1</Min><Max>2</Max>") +
         boolean("ReverseX", "0x33c") + boolean("ReverseY", "0x340") +
         integer("SensorWidth", "0x11c", "RO", "") + integer("SensorHeight", "0x118", "RO", "") +
         integer("OffsetX", "0x130", "RW", "<Min>0</Min><Max>0</Max>") +
         integer("OffsetY", "0x134", "RW", "<Min>0</Min><Max>0</Max>") +
         integer("Width", "0x100", "RW", "<pMin>SensorWidth</pMin><pMax>SensorWidth</pMax>") +
         integer("Height", "0x104", "RW", "<pMin>SensorHeight</pMin><pMax>SensorHeight</pMax>") +
         pixel_formats() +

         category("AcquisitionControl",
                  {"AcquisitionMode", "AcquisitionStart", "AcquisitionStop", "TriggerSelector",
                   "TriggerMode", "TriggerSource", "TriggerActivation", "ExposureTime"}) +
         enumeration("AcquisitionMode", {{"Continuous", "1"}}, "0x12c") +
         command("AcquisitionStart", "AcquisitionRegister", "1") +
         command("AcquisitionStop", "AcquisitionRegister", "0") +
         reg("AcquisitionRegister", "0x124") +
         node("Enumeration", "TriggerSelector",
              node("EnumEntry", "FrameStart", text("Value", "0")) +
                  text("pValue", "TriggerSelectorValue")) +
         node("Integer", "TriggerSelectorValue", text("Value", "0")) +
         enumeration("TriggerMode", {{"Off", "0"}, {"On", "1"}}, "0x300", kBySelector) +
         enumeration("TriggerSource", {{"Line1", "1"}, {"Action1", "2"}},
                     std::to_string(registers::kTriggerSource)) +
         enumeration("TriggerActivation", {{"RisingEdge", "0"}, {"FallingEdge", "1"}}, "0x308",
                     kBySelector) +
         scaled_float("ExposureTime", "0x120", "1", "<Min>10</Min><Max>1000000</Max>") +
         enumeration("ExposureAuto", {{"Off", "0"}, {"Continuous", "1"}}, "0x1e0") +

         category("AnalogControl", {"Gain", "GainAuto", "BalanceWhiteAuto", "GammaEnable", "Gamma",
                                    "BlackLevel", "BlackLevelAuto"}) +
         enumeration("BalanceWhiteAuto", {{"Off", "0"}, {"Continuous", "1"}}, "0x344") +
         boolean("GammaEnable", "0x348") +
         scaled_float("Gamma", "0x380", "100", "<Min>0</Min><Max>4</Max>") +
         scaled_float("BlackLevel", "0x34c", "10", "<Min>0</Min><Max>100</Max>") +
         enumeration("BlackLevelAuto", {{"Off", "0"}, {"Continuous", "1"}}, "0x384") +

         category("DigitalIOControl", {"LineSelector", "LineMode", "LineSource"}) +
         enumeration("LineSelector", {{"Line1", "0"}, {"Line2", "1"}}, "0x350") +
         enumeration("LineMode", {{"Input", "0"}, {"Output", "1"}}, "0x388", kByLine) +
         enumeration("LineSource", {{"Off", "0"}, {"ExposureActive", "1"}}, "0x390", kByLine) +

         // As in SFNC, the device key cannot be read back.
         category("ActionControl", {"ActionUnconditionalMode", "ActionDeviceKey", "ActionSelector",
                                    "ActionGroupKey", "ActionGroupMask"}) +
         enumeration("ActionUnconditionalMode", {{"Off", "0"}, {"On", "1"}},
                     std::to_string(registers::kActionUnconditional)) +
         integer("ActionDeviceKey", std::to_string(registers::kActionDeviceKey), "WO", "") +
         integer("ActionSelector", std::to_string(registers::kActionSelector), "RW",
                 "<Min>1</Min><Max>1</Max>") +
         integer("ActionGroupKey", std::to_string(registers::kActionGroupKey), "RW", "") +
         integer("ActionGroupMask", std::to_string(registers::kActionGroupMask), "RW", "") +

         category("UserSetControl", {"UserSetSelector", "UserSetLoad"}) +
         enumeration("UserSetSelector", {{"Default", "0"}, {"UserSet1", "1"}}, "0x35c") +
         command("UserSetLoad", "UserSetRegister", "1") + reg("UserSetRegister", "0x360") +

         scaled_float("Gain", "0x110", "100", "<Min>0</Min><Max>24</Max>") +
         enumeration("GainAuto", {{"Off", "1"}, {"Continuous", "2"}}, "0x114") +

         category("TransportLayerControl", {"PayloadSize", "TLParamsLocked"}) +
         node("IntSwissKnife", "PayloadSize",
              "<pVariable Name=\"W\">Width</pVariable><pVariable Name=\"H\">Height</pVariable>"
              "<pVariable Name=\"F\">PixelFormat</pVariable>"
              "<Formula>W * H * ((F &gt;&gt; 16) &amp; 0xFF) / 8</Formula>") +
         node("Integer", "TLParamsLocked", "<Value>0</Value><Min>0</Min><Max>1</Max>") +
         "<Port Name=\"Device\"/>\n</RegisterDescription>\n";
}

}  // namespace v3d::sim
