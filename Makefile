# Builds, tests and installs sst. `make help` lists the targets.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0

VERSION := 0.2.0
PREFIX ?= /usr/local
SYSCONFDIR ?= /etc
LIBDIR ?= $(PREFIX)/lib
# Plugins are found relative to the programs, so that an installed tree can be moved.
PLUGINDIR ?= $(LIBDIR)/sst
ifneq (,$(filter-out $(PREFIX)/%,$(PLUGINDIR)))
$(error PLUGINDIR=$(PLUGINDIR) is not below PREFIX=$(PREFIX), where the programs look for their plugins; choose another one)
endif
DESTDIR ?=
BUILD ?= build$(if $(ARCH),-$(ARCH))$(if $(SAN),-$(subst $(comma),-,$(SAN)))
comma := ,
hash := \#
# ARCH=arm64 cross-compiles with the libraries that `make deps` unpacks then; LIBRARIES=all: of every optional part too.
ifeq (arm64,$(ARCH))
SYSROOT ?= $(CURDIR)/build-arm64/sysroot
CC = aarch64-linux-gnu-gcc --sysroot=$(SYSROOT)
CXX = aarch64-linux-gnu-g++ --sysroot=$(SYSROOT)
AR = aarch64-linux-gnu-ar
PKG_CONFIG ?= env PKG_CONFIG_SYSROOT_DIR=$(SYSROOT) PKG_CONFIG_LIBDIR=$(SYSROOT)/usr/lib/aarch64-linux-gnu/pkgconfig:$(SYSROOT)/usr/share/pkgconfig pkg-config
endif
CC ?= gcc
CXX ?= g++
PKG_CONFIG ?= pkg-config
PYTHON ?= /usr/bin/python3

# --- optional parts: present packages are used, WITH_X=0 builds without -------------------------------------------
have = $(shell $(PKG_CONFIG) --exists $(1) 2>/dev/null && echo 1 || echo 0)
WITH_OPENCV ?= $(call have,opencv4)
WITH_AVFORMAT ?= $(call have,libavformat libavcodec libavutil libswscale)
# Versions 2 and 3 of oneDNN: compat_dnnl.c.
WITH_DNNL ?= $(shell printf '%s\n' '$(hash)include <dnnl_version.h>' DNNL_VERSION_MAJOR | $(CC) -E -P - 2>/dev/null | grep -qx '[23]' && echo 1 || echo 0)
WITH_DEFLATE ?= $(call have,libdeflate)
WITH_UDEV ?= $(call have,libudev)
WITH_USB ?= $(call have,libusb-1.0)
WITH_MODBUS ?= $(call have,libmodbus)
# Still cameras, and their raw files.
WITH_GPHOTO2 ?= $(call have,libgphoto2)
WITH_RAW ?= $(call have,libraw_r)
# Cameras of GigE Vision and USB3 Vision.
WITH_ARAVIS ?= $(call have,aravis-0.8)
# Handlers of messages of one file alone came with 4.5.
WITH_TIFF ?= $(shell $(PKG_CONFIG) --atleast-version=4.5 libtiff-4 2>/dev/null && echo 1 || echo 0)
WITH_HTTPD ?= $(call have,libmicrohttpd gnutls)
# Pictures between hosts by datagrams with error correction.
WITH_ISAL ?= $(call have,libisal)
WITH_SYSTEMD ?= $(call have,libsystemd)
WITH_RTSP ?= $(call have,gstreamer-rtsp-server-1.0 gstreamer-rtsp-1.0 gstreamer-app-1.0)
WITH_MQTT ?= $(call have,libmosquitto)
WITH_CURL ?= $(call have,libcurl)
# Notifications of browsers: agreement on keys by Nettle, beside GnuTLS.
WITH_PUSH ?= $(if $(filter 11,$(WITH_HTTPD)$(WITH_CURL)),$(call have,nettle hogweed),0)
WITH_DOGLEG ?= $(shell echo '$(hash)include <dogleg.h>' | $(CC) -I$(SYSROOT)/usr/include/suitesparse -E - >/dev/null 2>&1 && echo 1 || echo 0)
# The loader is opened at run time: building needs headers, and glslangValidator for the shaders.
WITH_VULKAN ?= $(shell command -v glslangValidator >/dev/null && echo '$(hash)include <vulkan/vulkan_core.h>' | $(CC) -E - >/dev/null 2>&1 && echo 1 || echo 0)
# sst-rtsp, sst-mqtt and sst-onvif are clients of the service.
WITH_ONVIF ?= $(if $(filter 11,$(WITH_HTTPD)$(call have,expat)),1,0)
ifneq (1,$(WITH_CURL))
override WITH_RTSP := 0
override WITH_MQTT := 0
override WITH_ONVIF := 0
endif
# Which API libgpiod has: 1, 2 or 0 for none.
WITH_GPIOD ?= $(shell $(PKG_CONFIG) --atleast-version=2 libgpiod 2>/dev/null && echo 2 || { $(PKG_CONFIG) --exists libgpiod 2>/dev/null && echo 1 || echo 0; })

# Looked for once, not for each file.
$(foreach w,$(filter WITH_%,$(.VARIABLES)),$(eval $(w) := $($(w))))

PACKAGES := libpng libturbojpeg libjpeg jansson yaml-0.1 zlib \
            $(if $(filter 1,$(WITH_DEFLATE)),libdeflate) $(if $(filter 1,$(WITH_UDEV)),libudev) $(if $(filter 1,$(WITH_USB)),libusb-1.0) \
            $(if $(filter 1,$(WITH_MODBUS)),libmodbus) $(if $(filter 1,$(WITH_HTTPD)),libmicrohttpd gnutls) \
            $(if $(filter 1,$(WITH_SYSTEMD)),libsystemd) $(if $(filter 1,$(WITH_CURL)),libcurl) $(if $(filter 1,$(WITH_PUSH)),hogweed nettle) \
            $(if $(filter 1 2,$(WITH_GPIOD)),libgpiod) $(if $(filter 1,$(WITH_ISAL)),libisal)

# --- flags ---------------------------------------------------------------------------------------------------------
# What a row of a table leaves out is zero.
WARN := -Wall -Wextra -Wshadow -Wvla -Wundef -Wconversion -Wno-sign-conversion -Wno-missing-field-initializers \
        $(if $(WERROR),-Werror)
# Warnings are the plain build's: with less optimisation gcc guesses worse, and a sanitized build takes a seventh less time without them.
ifneq (,$(SAN))
WARN := -w
endif
CWARN = $(WARN) $(if $(SAN),,-Wstrict-prototypes -Wmissing-prototypes)
TARGET := $(shell $(CC) -dumpmachine)
HARDEN := -fstack-protector-strong -fstack-clash-protection -fPIE \
          $(if $(filter x86_64%,$(TARGET)),-fcf-protection) $(if $(filter aarch64%,$(TARGET)),-mbranch-protection=standard) \
          $(if $(SAN),,-D_FORTIFY_SOURCE=2)
PIE := -pie
# Under the address sanitizer, programs at a fixed address that gold links, where it is installed, take a third of the time to link.
ifneq (,$(findstring address,$(SAN)))
HARDEN := -fno-pie
PIE := -no-pie
GOLD := $(if $(shell command -v ld.gold),-fuse-ld=gold)
endif
# A sanitized build is compiled three times as fast with -O1, and its reports need lines alone.
OPT ?= $(if $(SAN),-O1 -g1,-O3 -g)
# Programs and devices' drivers, which compute little, are compiled in half of that time with -O0;
SLIGHT := capture/% cli/% config/% daemon/% drivers/% publishers/% simulators/devices/%
ifneq (,$(SAN))
$(SLIGHT:%=$(BUILD)/obj/%.o): OPT = -O0 -g1
endif
# ... kernels, references of shaders and drawn scenes, in which sanitized tests spend most of their time, with -O2.
ifneq (,$(SAN))
$(BUILD)/obj/pipeline/kernels/%.o $(BUILD)/obj/pipeline/gpu/%.o $(BUILD)/obj/simulators/scene/%.o $(BUILD)/obj/simulators/flight/%.o: OPT = -O2 -g1
# Tests whose input is a drawn scene have it drawn as in the plain build, without a sanitizer. The address sanitizer watches all of it in
# tests that tests/special.txt marks `draws`; the thread sanitizer needs the loops over bands and views alone, since scenes are constant
# while they are drawn.
DRAWING := $(filter-out %/layers.c %/write.c,$(wildcard simulators/scene/*.c simulators/flight/*.c))
DRAWN_OBJ := $(DRAWING:%.c=$(BUILD)/obj/drawn/%.o)
DRAWN_LIB := $(BUILD)/libsst-drawn.a
DRAWS := $(if $(findstring thread,$(SAN)),,$(shell sed -nE 's,^([a-z_/]+) +draws.*,$(BUILD)/tests/\1,p' tests/special.txt))
endif
# Levels of kernels that this processor has not are only compiled there.
ifneq (,$(SAN))
LACKED := $(if $(shell grep -sw avx512f /proc/cpuinfo | head -n 1),,avx512) $(if $(shell grep -swE 'avx_vnni|avx512f' /proc/cpuinfo | head -n 1),,avxvnni)
$(LACKED:%=$(BUILD)/obj/pipeline/kernels/x86/%.o): OPT = -O0 -g1
endif
# KERNEL_OPT=FLAGS: of kernels alone.
ifdef KERNEL_OPT
$(BUILD)/obj/pipeline/kernels/%.o: override OPT = $(KERNEL_OPT)
endif
SANFLAGS := $(if $(SAN),-fsanitize=$(SAN) -fno-omit-frame-pointer)
# Compilers may compute what is masked away, unless floating-point exceptions count: then tests end at them (tests/traps.h).
TRAPPING := -fno-trapping-math
ifneq (,$(findstring undefined,$(SAN)))
SANFLAGS += -fsanitize=float-divide-by-zero,float-cast-overflow -fno-sanitize-recover=all
TRAPPING := -ftrapping-math -DSST_TRAPS
endif
# What the address sanitizer sees at each access is not checked twice: builds and tests take three quarters of the time. Of
# pointers beyond their object and null pointers that are counted up, clang alone notices something: make fuzz has it.
ifneq (,$(and $(findstring address,$(SAN)),$(findstring undefined,$(SAN))))
SANFLAGS += -fno-sanitize=null,object-size,pointer-overflow
$(BUILD)/obj/pipeline/kernels/%.o $(BUILD)/obj/pipeline/gpu/%.o: SANFLAGS += -fno-sanitize=alignment
endif
# Not-a-numbers and the order of sums mean something here.
ifneq (,$(filter -ffast-math -Ofast -ffinite-math-only -funsafe-math-optimizations -fassociative-math -freciprocal-math -fno-signed-zeros,$(CFLAGS) $(CXXFLAGS) $(OPT)))
$(error $(CFLAGS) $(CXXFLAGS) $(OPT): -ffast-math and its parts change results; build without them)
endif
DEFS := -DSST_VERSION='"$(VERSION)"' -DWITH_OPENCV=$(WITH_OPENCV) -DWITH_AVFORMAT=$(WITH_AVFORMAT) \
        -DWITH_DNNL=$(WITH_DNNL) -DWITH_UDEV=$(WITH_UDEV) -DWITH_USB=$(WITH_USB) -DWITH_MODBUS=$(WITH_MODBUS) \
        -DWITH_GPIOD=$(WITH_GPIOD) -DWITH_DOGLEG=$(WITH_DOGLEG) -DWITH_DEFLATE=$(WITH_DEFLATE) -DWITH_HTTPD=$(WITH_HTTPD) \
        -DWITH_SYSTEMD=$(WITH_SYSTEMD) -DWITH_RTSP=$(WITH_RTSP) -DWITH_MQTT=$(WITH_MQTT) -DWITH_ONVIF=$(WITH_ONVIF) \
        -DWITH_CURL=$(WITH_CURL) -DWITH_VULKAN=$(WITH_VULKAN) -DWITH_GPHOTO2=$(WITH_GPHOTO2) -DWITH_ARAVIS=$(WITH_ARAVIS) -DWITH_RAW=$(WITH_RAW) -DWITH_TIFF=$(WITH_TIFF) -DWITH_ISAL=$(WITH_ISAL) -DWITH_PUSH=$(WITH_PUSH) -DSST_DATADIR='"$(PREFIX)/share/sst"'
AV_PACKAGES := $(if $(filter 1,$(WITH_AVFORMAT)),libavformat libavcodec libavutil libswscale)
PACKAGE_CFLAGS := $(subst -I,-isystem ,$(shell $(PKG_CONFIG) --cflags $(PACKAGES) $(AV_PACKAGES)))
PACKAGE_LIBS := $(shell $(PKG_CONFIG) --libs $(PACKAGES))
BASEFLAGS = -I. -I$(BUILD) $(OPT) -ffp-contract=off -fno-math-errno $(TRAPPING) -pthread $(HARDEN) $(SANFLAGS) $(DEFS) -MMD -MP
CFLAGS_ALL = -std=c11 -D_DEFAULT_SOURCE -D_POSIX_C_SOURCE=200809L -D_FILE_OFFSET_BITS=64 $(BASEFLAGS) $(CWARN) \
             $(PACKAGE_CFLAGS) $(CFLAGS)
# OpenCV's headers do not survive our warnings.
CXXFLAGS_ALL = -std=c++17 $(BASEFLAGS) -fPIC $(WARN) $(subst -I,-isystem ,$(shell $(PKG_CONFIG) --cflags opencv4 2>/dev/null)) $(CXXFLAGS)
LIBS = $(PACKAGE_LIBS) $(if $(filter 1,$(WITH_PUSH)),-lgmp) -lmd -lm \
       $(if $(filter 1,$(WITH_DNNL)),-ldnnl -lgomp) \
       $(if $(filter 1,$(WITH_DOGLEG)),-ldogleg -lcholmod -llapack)
OPENCV_LIBS := -lopencv_dnn -lopencv_aruco -lopencv_features2d -lopencv_objdetect -lopencv_calib3d -lopencv_imgproc -lopencv_core -lstdc++
AV_LIBS := $(if $(AV_PACKAGES),$(shell $(PKG_CONFIG) --libs $(AV_PACKAGES)))
LDFLAGS_ALL = $(PIE) $(GOLD) -Wl,--as-needed -Wl,-z,relro,-z,now -pthread $(SANFLAGS) $(LDFLAGS)

# --- sources -------------------------------------------------------------------------------------------------------
# Simulated devices go into sst-sim and the library that it preloads, never into the product.
SIM_SRC := $(sort $(wildcard simulators/devices/*.c simulators/devices/camera/*.c simulators/devices/server/*.c))
PRELOAD_SRC := $(sort $(wildcard simulators/devices/preload/*.c))
# Sources of optional parts, by whether they are built; gpio_none.c, sysfs.c and tiff_none.c replace parts that have callers without them.
OPTIONAL_AVFORMAT := capture/recording/libav.c
OPTIONAL_DEFLATE := pipeline/image/png_plain.c
OPTIONAL_DNNL := $(addprefix pipeline/method/network/,plan.c plan_bits.c plan_conv.c plan_tiles.c device_plan.c plan_dnnl.c compat_dnnl.c sample.c)
OPTIONAL_HTTPD := $(patsubst %,daemon/publish/http_%.c,access check download events peer reply request stream video watch web)
OPTIONAL_ISAL := pipeline/image/png_pack.c
OPTIONAL_TIFF := $(addprefix pipeline/image/,file_tiff.c tiff.c tiff_grid.c)
OPTIONAL_UDEV := drivers/grab/udev.c
OPTIONAL_VULKAN := $(filter-out pipeline/gpu/vulkan.c,$(wildcard pipeline/gpu/vulkan*.c))
LEFT_OUT := $(foreach x,AVFORMAT DEFLATE DNNL HTTPD ISAL TIFF UDEV VULKAN,$(if $(filter 1,$(WITH_$(x))),,$(OPTIONAL_$(x)))) \
            $(filter-out drivers/trigger/gpio_$(if $(filter 1 2,$(WITH_GPIOD)),v$(WITH_GPIOD),none).c,$(wildcard drivers/trigger/gpio_*.c)) \
            $(if $(filter 1,$(WITH_TIFF)),pipeline/image/tiff_none.c) $(if $(filter 1,$(WITH_UDEV)),drivers/grab/sysfs.c)
# libsst-video.so
VIDEO_SRC := pipeline/video/mp4_libav.c pipeline/video/h264_libav.c
LIB_SRC := $(sort $(filter-out daemon/main.c drivers/still/lib_gphoto.c drivers/genicam/lib_aravis.c $(VIDEO_SRC) $(LEFT_OUT),$(wildcard base/*.c config/*.c drivers/*/*.c capture/*/*.c pipeline/*/*.c \
           pipeline/*/*/*.c client/*.c daemon/*.c daemon/*/*.c)))
SHIM_SRC := $(if $(filter 1,$(WITH_OPENCV)),$(sort $(wildcard pipeline/*/*/*.cc)))
# Simulated worlds, for sst-sim, sst scene, sst demo and the tests; the daemon does not link them.
WORLD_SRC := $(sort $(wildcard simulators/scene/*.c simulators/scene/*/*.c simulators/flight/*.c simulators/rig/*.c simulators/devices/gpio/*.c \
             simulators/devices/ptp/*.c simulators/devices/usb/*.c))
CLI_SRC := $(sort $(wildcard cli/*.c))
# Programs beside the service, and what they alone link.
PUBLISHERS := $(if $(filter 1,$(WITH_RTSP)),rtsp) $(if $(filter 1,$(WITH_MQTT)),mqtt) $(if $(filter 1,$(WITH_ONVIF)),onvif)
PACKAGES_rtsp := gstreamer-rtsp-server-1.0 gstreamer-rtsp-1.0 gstreamer-app-1.0
PACKAGES_mqtt := libmosquitto
PACKAGES_onvif := expat
publisher_obj = $(patsubst %.c,$(BUILD)/obj/%.o,$(sort $(wildcard publishers/*.c publishers/$(1)/*.c)))
# What starts no thread of its own is nothing for the thread sanitizer.
NO_THREADS := $(if $(findstring thread,$(SAN)),$(shell sed -nE 's,^([^ ]+) +(one|same)-thread.*,tests/\1.c,p' tests/special.txt))
TEST_SRC := $(filter-out $(NO_THREADS),$(sort $(wildcard tests/unit/*.c tests/kernels/*.c tests/sim/*.c)))
SIM_OBJ := $(SIM_SRC:%.c=$(BUILD)/obj/%.o)
# The page is part of the program: its files as they are, and a table of them.
WEB_FILES := $(sort $(wildcard daemon/web/*))
# So are the shaders, compiled.
SHADERS := $(if $(filter 1,$(WITH_VULKAN)),$(sort $(wildcard pipeline/kernels/*.comp)))
SPIRV := $(SHADERS:pipeline/kernels/%.comp=$(BUILD)/shaders/%.spv)
WORLD_OBJ := $(WORLD_SRC:%.c=$(BUILD)/obj/%.o)
LIB_OBJ := $(LIB_SRC:%.c=$(BUILD)/obj/%.o) $(BUILD)/obj/web.o $(BUILD)/obj/spirv.o
SHIM_OBJ := $(SHIM_SRC:%.cc=$(BUILD)/obj/%.o)
# Loaded when first used (base/plugin.h), so that a start of sst does not load OpenCV and FFmpeg.
PLUGINS := $(if $(SHIM_OBJ),$(BUILD)/libsst-opencv.so) $(if $(filter 1,$(WITH_AVFORMAT)),$(BUILD)/libsst-video.so) \
           $(if $(filter 1,$(WITH_GPHOTO2)),$(BUILD)/libsst-gphoto.so) $(if $(filter 1,$(WITH_ARAVIS)),$(BUILD)/libsst-aravis.so)
# libsst-read: what its reader needs of these folders is position-independent, here and in the programs.
READ_SRC := $(filter $(foreach d,base $(addprefix pipeline/,image kernels kernels/x86 kernels/arm camera lightfield lightfield/rectify posed),$(wildcard $(d)/*.c)),$(LIB_SRC))
READ_OBJ := $(READ_SRC:%.c=$(BUILD)/obj/%.o) $(BUILD)/obj/read/read.o
READ_FLAGS := -fPIC -fno-semantic-interposition
READ_LIB := $(if $(SAN),,$(BUILD)/libsst-read.so.$(VERSION))
INCLUDEDIR ?= $(PREFIX)/include
CLI_OBJ := $(CLI_SRC:%.c=$(BUILD)/obj/%.o) $(BUILD)/obj/commands.o
TESTS := $(TEST_SRC:tests/%.c=$(BUILD)/tests/%)
# Programs that tests/system runs beside sst.
TOOLS := $(patsubst %.c,$(BUILD)/%,$(wildcard tests/tools/*.c)) $(if $(filter 1,$(WITH_VULKAN)),$(BUILD)/device_lost.so)
# Programs that tests/guest runs in the emulated machine.
GUEST_TESTS := $(patsubst %.c,$(BUILD)/%,$(sort $(wildcard tests/guest/*.c)))

.PHONY: FORCE all deps built built-plain built-address built-check check check-tests check-unit check-cli check-thread check-arm64 kernel-tests check-timing coverage check-includes check-names check-words check-structure check-kernel deps-kernel check-cluster deps-cluster check-nodes check-scale check-genicam check-onvif findings demo bench bench-quick bench-check bench-check-update bench-networks bench-calib bench-perturb bench-gpu bench-service bench-watch soak-service fuzz install install-built uninstall man help clean format tests fuzzers check-colmap deps-colmap check-law
.SECONDARY:
PROGRAMS := $(BUILD)/sst $(BUILD)/sstd $(PUBLISHERS:%=$(BUILD)/sst-%) $(if $(SIM_SRC),$(BUILD)/sst-sim $(BUILD)/libsst-sim-preload.so) $(PLUGINS) $(READ_LIB)
all: $(PROGRAMS) ## build the programs into build/: sst, sstd, sst-rtsp, sst-mqtt, sst-onvif, sst-sim (simulated devices), and their plugins

# Objects of other flags or optional parts are rebuilt.
FLAGS = $(filter-out -Werror,$(PLUGINDIR:$(PREFIX)/%=%) $(CC) $(CFLAGS_ALL) $(CXX) $(CXXFLAGS_ALL) $(LIBS) $(OPENCV_LIBS) $(AV_LIBS) $(READ_FLAGS))
$(BUILD)/flags: $(BUILD)/shaders.h FORCE
	@mkdir -p $(@D)
	@echo '$(subst ','\'',$(FLAGS))' | cmp -s - $@ || echo '$(subst ','\'',$(FLAGS))' > $@
FORCE:
# The lists of shaders, one of each file.
$(BUILD)/shaders.h: scripts/shaders.sh FORCE
	@mkdir -p $(@D)
	@scripts/shaders.sh $(sort $(basename $(notdir $(wildcard pipeline/kernels/*.comp)))) >$@.new
	@cmp -s $@.new $@ && rm $@.new || mv $@.new $@

$(BUILD)/obj/%.o: %.c $(BUILD)/flags
	@mkdir -p $(@D)
	@echo "  CC   $<"
	@$(CC) $(CFLAGS_ALL) -c $< -o $@
# GCC 12 for arm64 fails with an internal error where it vectorises fmin() and fmax() over a loop.
ifneq (,$(filter aarch64%,$(TARGET)))
$(BUILD)/obj/simulators/scene/scene.o $(BUILD)/obj/pipeline/calibration/photometric/photometric_fit.o: private CFLAGS_ALL += -fno-tree-loop-vectorize
endif
$(DRAWN_OBJ): private OPT := -O3 -g1
$(DRAWN_OBJ): private SANFLAGS :=
$(DRAWN_OBJ): private TRAPPING := -fno-trapping-math
$(DRAWN_OBJ): $(BUILD)/obj/drawn/%.o: %.c $(BUILD)/flags
	@mkdir -p $(@D)
	@echo "  CC   $< (drawn)"
	@$(CC) $(CFLAGS_ALL) -c $< -o $@
# Files that the assembler includes.
$(BUILD)/obj/pipeline/calibration/report/report.o: pipeline/calibration/report/report.html
$(BUILD)/obj/simulators/scene/models.o $(BUILD)/obj/drawn/simulators/scene/models.o: simulators/scene/models.txt
$(BUILD)/obj/publishers/mqtt/discovery.o: publishers/mqtt/entities.json
$(BUILD)/obj/publishers/onvif/answers.o: publishers/onvif/answers.txt
$(BUILD)/obj/simulators/devices/main.o: simulators/devices/help.txt
$(BUILD)/obj/cli/status.o: cli/status.txt
$(BUILD)/obj/base/plugin.o $(BUILD)/obj/simulators/devices/session.o: private CFLAGS_ALL += -DSST_PLUGINDIR='"$(PLUGINDIR:$(PREFIX)/%=%)"'
# Headers of cholmod, which dogleg.h names without their folder on Debian 13.
$(BUILD)/obj/pipeline/calibration/solve/solve_adjust.o: private CFLAGS_ALL += -isystem $(SYSROOT)/usr/include/suitesparse
# libcurl is loaded when it is first used.
ifeq (1,$(WITH_CURL))
$(BUILD)/obj/base/curl.o: private CFLAGS_ALL += -DSST_CURL_LIBRARY='"$(shell readelf -d $$($(CC) -print-file-name=$(patsubst -l%,lib%.so,$(filter -lcurl%,$(PACKAGE_LIBS)))) | sed -n 's/.*(SONAME).*\[\(.*\)\]/\1/p')"'
endif
# So is LibRaw.
ifeq (1,$(WITH_RAW))
$(BUILD)/obj/pipeline/image/develop.o: private CFLAGS_ALL += $(subst -I,-isystem ,$(shell $(PKG_CONFIG) --cflags libraw_r)) \
    -DSST_RAW_LIBRARY='"$(shell readelf -d $$($(CC) -print-file-name=libraw_r.so) | sed -n 's/.*(SONAME).*\[\(.*\)\]/\1/p')"'
endif
# And libtiff, but for tests, which make files by it.
ifeq (1,$(WITH_TIFF))
TIFF_LIBS := $(shell $(PKG_CONFIG) --libs libtiff-4)
$(addprefix $(BUILD)/obj/pipeline/image/,file_tiff.o tiff.o tiff_grid.o): private CFLAGS_ALL += $(subst -I,-isystem ,$(shell $(PKG_CONFIG) --cflags libtiff-4)) \
    -DSST_TIFF_LIBRARY='"$(shell readelf -d $$($(CC) -print-file-name=libtiff.so) | sed -n 's/.*(SONAME).*\[\(.*\)\]/\1/p')"'
$(BUILD)/tests/unit/tiff $(BUILD)/tests/unit/heights $(BUILD)/tests/fuzz/tiff: private LIBS += $(TIFF_LIBS)
endif
# Where plugins of GStreamer are: they are loaded one by one.
$(BUILD)/obj/publishers/rtsp/%.o $(BUILD)/obj/tests/unit/rtsp_jpeg.o: private CFLAGS_ALL += $(subst -I,-isystem ,$(shell $(PKG_CONFIG) --cflags $(PACKAGES_rtsp))) \
    -DSST_GST_PLUGINS='"$(shell $(PKG_CONFIG) --variable=pluginsdir gstreamer-1.0 2>/dev/null)"'
$(BUILD)/obj/%.o: %.cc $(BUILD)/flags
	@mkdir -p $(@D)
	@echo "  CXX  $<"
	@$(CXX) $(CXXFLAGS_ALL) -c $< -o $@
$(BUILD)/web.c: scripts/embed.sh $(WEB_FILES) daemon/web
	@mkdir -p $(@D)
	@scripts/embed.sh web_files daemon/publish/publish_internal.h $(WEB_FILES) >$@.new && mv $@.new $@
$(BUILD)/shaders/%.spv: pipeline/kernels/%.comp $(wildcard pipeline/kernels/*.glsl)
	@mkdir -p $(@D)
	@echo "  GLSL $<"
	@glslangValidator -V --quiet --target-env vulkan1.2 -o $@ $<
$(filter $(BUILD)/shaders/net_conv8%,$(SPIRV)): pipeline/kernels/net_conv8.glsl
$(BUILD)/spirv.c: scripts/embed.sh $(SPIRV) $(BUILD)/flags
	@scripts/embed.sh gpu_spirvs pipeline/gpu/gpu_internal.h $(SPIRV) >$@.new && mv $@.new $@
$(BUILD)/commands.c: scripts/commands.sh cli/commands.txt
	@mkdir -p $(@D)
	@scripts/commands.sh cli/commands.txt >$@.new && mv $@.new $@
$(BUILD)/obj/web.o $(BUILD)/obj/spirv.o $(BUILD)/obj/commands.o: $(BUILD)/obj/%.o: $(BUILD)/%.c $(BUILD)/flags
	@mkdir -p $(@D)
	@echo "  CC   $<"
	@$(CC) $(CFLAGS_ALL) -c $< -o $@
$(BUILD)/libsst.a: $(LIB_OBJ)
	@rm -f $@
	@$(AR) rcs $@ $^
$(BUILD)/libsst-sim.a: $(WORLD_OBJ)
	@rm -f $@
	@$(AR) rcs $@ $^
$(DRAWN_LIB): $(DRAWN_OBJ) $(filter-out $(DRAWING:%.c=$(BUILD)/obj/%.o),$(WORLD_OBJ))
	@rm -f $@
	@$(AR) rcs $@ $^
$(BUILD)/sst: $(CLI_OBJ) $(BUILD)/libsst-sim.a $(BUILD)/libsst.a
	@echo "  LD   $@"
	@$(CC) $(LDFLAGS_ALL) $^ $(LIBS) -o $@
$(BUILD)/libsst-opencv.so: $(SHIM_OBJ)
	@echo "  LD   $@"
	@$(CXX) -shared $(filter-out $(PIE),$(LDFLAGS_ALL)) $^ $(OPENCV_LIBS) -o $@
VIDEO_OBJ := $(VIDEO_SRC:%.c=$(BUILD)/obj/%.o)
$(VIDEO_OBJ): private CFLAGS_ALL += -fPIC
$(BUILD)/libsst-video.so: $(VIDEO_OBJ)
	@echo "  LD   $@"
	@$(CC) -shared $(filter-out $(PIE),$(LDFLAGS_ALL)) $^ $(AV_LIBS) -o $@
$(BUILD)/obj/drivers/still/lib_gphoto.o: private CFLAGS_ALL += -fPIC $(subst -I,-isystem ,$(shell $(PKG_CONFIG) --cflags libgphoto2))
$(BUILD)/libsst-gphoto.so: $(BUILD)/obj/drivers/still/lib_gphoto.o
	@echo "  LD   $@"
	@$(CC) -shared $(filter-out $(PIE),$(LDFLAGS_ALL)) $^ $(shell $(PKG_CONFIG) --libs libgphoto2) -o $@
# Its objects as an archive, of which the linker takes what the reader calls; names that read.map does not list stay inside.
$(READ_OBJ): private CFLAGS_ALL += $(READ_FLAGS)
$(BUILD)/libsst-read.a: $(READ_OBJ)
	@rm -f $@
	@$(AR) rcs $@ $^
$(BUILD)/libsst-read.so.$(VERSION): $(BUILD)/libsst-read.a read/read.map
	@echo "  LD   $@"
	@$(CC) -shared $(filter-out $(PIE),$(LDFLAGS_ALL)) -Wl,-z,defs -Wl,-soname,libsst-read.so.0 -Wl,--version-script=read/read.map \
	      $(BUILD)/obj/read/read.o $< $(PACKAGE_LIBS) -lmd -lm -o $@
	@ln -sf $(@F) $(BUILD)/libsst-read.so.0 && ln -sf libsst-read.so.0 $(BUILD)/libsst-read.so
# Formats of pixels are known to both.
ARAVIS_OBJ := $(BUILD)/obj/drivers/genicam/lib_aravis.o $(BUILD)/obj/drivers/genicam/pixels.o
$(ARAVIS_OBJ): private CFLAGS_ALL += -fPIC $(subst -I,-isystem ,$(shell $(PKG_CONFIG) --cflags aravis-0.8 2>/dev/null))
$(BUILD)/libsst-aravis.so: $(ARAVIS_OBJ)
	@echo "  LD   $@"
	@$(CC) -shared $(filter-out $(PIE),$(LDFLAGS_ALL)) $^ $(shell $(PKG_CONFIG) --libs aravis-0.8) -lm -o $@
$(BUILD)/sstd: $(BUILD)/obj/daemon/main.o $(BUILD)/libsst.a
	@echo "  LD   $@"
	@$(CC) $(LDFLAGS_ALL) $^ $(LIBS) -o $@
define publisher
$(BUILD)/sst-$(1): $(call publisher_obj,$(1)) $(BUILD)/libsst.a
	@echo "  LD   $$@"
	@$$(CC) $$(LDFLAGS_ALL) $$^ $$(LIBS) $$(shell $(PKG_CONFIG) --libs $$(PACKAGES_$(1))) -o $$@
-include $(patsubst %.o,%.d,$(call publisher_obj,$(1)))
endef
$(foreach p,$(PUBLISHERS),$(eval $(call publisher,$(p))))
$(BUILD)/sst-sim: $(SIM_OBJ) $(BUILD)/libsst-sim.a $(BUILD)/libsst.a
	@echo "  LD   $@"
	@$(CC) $(LDFLAGS_ALL) $^ $(LIBS) -o $@
# Loaded into other people's programs: libc alone, never a sanitizer.
$(BUILD)/libsst-sim-preload.so: $(PRELOAD_SRC) $(wildcard simulators/devices/*.h simulators/devices/preload/*.h) base/base.h
	@mkdir -p $(@D)
	@echo "  LD   $@"
	@$(CC) -std=gnu11 -I. -O2 -g $(filter-out -fPIE -D_FORTIFY%,$(HARDEN)) -D_FORTIFY_SOURCE=2 -fPIC -shared -Wl,-z,relro,-z,now -fvisibility=hidden -pthread \
	      $(CWARN) $(filter -ffile-prefix-map=%,$(CFLAGS)) $(PRELOAD_SRC) $(filter -Wl%,$(LDFLAGS)) -ldl -o $@
$(BUILD)/tests/%: $(BUILD)/obj/tests/%.o $(DRAWN_LIB) $(BUILD)/libsst-sim.a $(BUILD)/libsst.a | $(PLUGINS)
	@mkdir -p $(@D)
	@$(CC) $(LDFLAGS_ALL) $(filter-out $(other_world),$^) $(LIBS) $(AV_LIBS) -lcmocka -o $@
other_world = $(if $(filter $@,$(DRAWS)),$(DRAWN_LIB),$(if $(DRAWN_LIB),$(BUILD)/libsst-sim.a))

ifeq (1,$(WITH_RTSP))
$(BUILD)/tests/unit/rtsp_jpeg: $(BUILD)/obj/publishers/rtsp/jpeg.o
endif
# All of sst-onvif but its HTTP server and main().
ifeq (1,$(WITH_ONVIF))
$(BUILD)/tests/unit/onvif $(BUILD)/tests/fuzz/onvif: $(filter-out %/http.o %/main.o,$(call publisher_obj,onvif))
$(BUILD)/tests/unit/onvif $(BUILD)/tests/fuzz/onvif: private LIBS := $(BUILD)/libsst.a $(LIBS) $(shell $(PKG_CONFIG) --libs $(PACKAGES_onvif))
endif
$(BUILD)/tests/unit/read: $(BUILD)/obj/read/read.o
$(BUILD)/tests/unit/read: private LIBS := $(BUILD)/libsst.a $(LIBS)
# OpenCV's own calibration, which a test compares with.
ifeq (1,$(WITH_OPENCV))
$(BUILD)/tests/unit/solve_opencv: $(BUILD)/obj/tests/unit/solve_oracle.o
$(BUILD)/tests/unit/solve_opencv $(BUILD)/bench/stereo $(BUILD)/bench/render $(BUILD)/bench/rectify $(BUILD)/bench/posed: private LIBS += $(OPENCV_LIBS)
endif

# One program per file of tests/bench; three bring what they compare with.
BENCH_PROGRAMS := $(patsubst tests/bench/%.c,$(BUILD)/bench/%,$(wildcard tests/bench/*.c))
$(BUILD)/bench/stereo: $(BUILD)/obj/tests/bench/sgbm.o
$(BUILD)/bench/render: $(BUILD)/obj/tests/bench/blend.o
$(BUILD)/bench/rectify: $(BUILD)/obj/tests/bench/remap.o
$(BUILD)/bench/posed: $(BUILD)/obj/tests/bench/warp.o
$(BENCH_PROGRAMS): $(BUILD)/bench/%: $(BUILD)/obj/tests/bench/%.o $(BUILD)/libsst-sim.a $(BUILD)/libsst.a | $(PLUGINS)
	@mkdir -p $(@D)
	@echo "  LD   $@"
	@$(CC) $(LDFLAGS_ALL) $(filter %.o,$^) $(filter %.a,$^) $(LIBS) -o $@

# The manual page of the configuration comes from the table of its keys; a test compares it with the committed one.
# So do openapi.json and status.md from those of routes and fields.
$(BUILD)/api_tables: $(BUILD)/%: $(BUILD)/obj/scripts/%.o $(BUILD)/libsst.a
	@$(CC) $(LDFLAGS_ALL) $^ $(LIBS) -o $@
tests: $(TESTS) $(TOOLS) $(GUEST_TESTS)

deps: ## install what building and testing needs (Debian 12; root or sudo)
	scripts/deps.sh $(if $(ARCH),scripts/$(ARCH)/packages.txt)
	$(if $(ARCH),scripts/$(ARCH)/sysroot.sh $(SYSROOT) $(LIBRARIES))

# Tests run after everything is built, as many at a time as scripts/run_tests.sh finds right: docs in CONTRIBUTING.md.
PARALLEL = $(if $(filter -j%,$(MAKEFLAGS)),,-j$(shell nproc))
RUN_TESTS = SST_BUILD=$(BUILD) scripts/run_tests.sh
SYSTEM_TESTS := $(sort $(wildcard tests/system/*.sh))
# Optimised kernels are other code than sanitized ones, and plain_test() (tests/small.h) marks what sanitized builds leave out.
LEFT_TESTS := $(patsubst tests/%.c,$(BUILD)/tests/%,$(shell grep -l plain_test $(TEST_SRC)))
PLAIN_TESTS := $(filter $(BUILD)/tests/kernels/%,$(TESTS)) $(LEFT_TESTS)
# What depends on the processor is tested once more as on one with AVX2 alone, unless this is one, and kernels by their references.
AVX2_TESTS := $(if $(shell grep -swE 'avx512f|avx_vnni' /proc/cpuinfo | head -n 1),$(shell awk '/^[^\#]/ && $$2 == "processor" { print $$1 }' tests/special.txt))
LEVEL_TESTS := $(foreach t,$(AVX2_TESTS),avx2@$(or $(wildcard tests/$(t).sh),$(BUILD)/tests/$(t))) \
               $(patsubst %,ref@%,$(filter $(BUILD)/tests/kernels/%,$(TESTS)))
TIMING_TESTS := $(shell awk '/^[^\#]/ && $$2 == "timing" { print $$1 }' tests/special.txt)
ADDRESS := build-address-undefined

check: deps ## build with warnings as errors, once plain and once sanitized, and run every test
	$(MAKE) WERROR=1 $(PARALLEL) built-check
	@rc=0; echo "readers of files and messages, 10 s of mutations each:"; FUZZ_SECONDS=10 JOBS=15 $(RUN_TESTS) $(FUZZERS:%=$(ADDRESS)/tests/fuzz/%) || rc=1; \
	  $(RUN_TESTS) $(TESTS:$(BUILD)/%=$(ADDRESS)/%) $(filter-out $(LEFT_TESTS),$(PLAIN_TESTS)) $(LEFT_TESTS:%=plain@%) $(LEVEL_TESTS) $(SYSTEM_TESTS) || rc=1; \
	  [ $$rc -eq 0 ] || echo "make check: failed (what failed is above)"; exit $$rc

check-thread: deps ## unit and simulator tests that have threads, under the thread sanitizer
	$(MAKE) WERROR=1 $(PARALLEL) SAN=thread built
	JOBS=$${JOBS:-$$(($$(nproc) + 5))} $(MAKE) WERROR=1 SAN=thread check-unit # which wait for each other

check-timing: deps ## tests that measure time, with their limits; one that a busy machine fails runs again, twice at most
	$(MAKE) WERROR=1 $(PARALLEL) built-plain $(patsubst %,$(BUILD)/tests/%,$(filter-out system/%,$(TIMING_TESTS)))
	JOBS=5 RETRIES=2 SST_TIMING=1 $(RUN_TESTS) $(foreach t,$(TIMING_TESTS),$(or $(wildcard tests/$(t).sh),$(BUILD)/tests/$(t)))

# Tests under the thread sanitizer run the simulators and publishers alone.
built: $(if $(findstring thread,$(SAN)),$(filter-out $(BUILD)/sst $(BUILD)/sstd,$(PROGRAMS)),$(PROGRAMS)) $(TESTS) $(if $(SAN),,$(TOOLS))
built-plain: $(PROGRAMS) $(PLAIN_TESTS) $(patsubst %,$(BUILD)/tests/%,$(filter-out system/%,$(AVX2_TESTS))) $(TOOLS) $(BUILD)/api_tables
built-check: built-plain built-address check-includes check-names
built-address: $(BUILD)/one_thread.so
	+$(MAKE) SAN=address,undefined built fuzzers

check-tests: built $(BUILD)/api_tables
	@$(RUN_TESTS) $(TESTS) $(SYSTEM_TESTS)

check-unit: built
	@$(RUN_TESTS) $(TESTS)

check-cli: built-plain
	@$(RUN_TESTS) $(SYSTEM_TESTS)

# Loaded into tests that tests/special.txt says have one thread.
$(BUILD)/one_thread.so: tests/one_thread.c
	@mkdir -p $(@D)
	@$(CC) -std=gnu11 -D_GNU_SOURCE -fPIC -shared $(CWARN) $< -o $@

# Loaded by Vulkan's loader, into programs whose device a test takes away.
$(BUILD)/device_lost.so: tests/device_lost.c
	@mkdir -p $(@D)
	@$(CC) -std=gnu11 -D_GNU_SOURCE -fPIC -shared -pthread -fvisibility=hidden $(CWARN) $< -o $@

check-arm64: ## build everything for arm64 with a cross compiler and run the tests of kernels in an emulator
	scripts/arm64/check.sh
# Counts instructions by function, in the emulator.
$(BUILD)/arm64_profile.so: scripts/arm64/profile.c
	@mkdir -p $(@D)
	@$(CC) -std=gnu11 -I. -O2 -fPIC -shared $(CWARN) $< -o $@
kernel-tests: $(filter $(BUILD)/tests/kernels/%,$(TESTS))

findings: ## run what is known of real libraries and tools that do otherwise than one would guess; downloads pinned packages
	scripts/findings.sh

deps-cluster: ## install what check-cluster needs besides
	scripts/deps.sh scripts/cluster/packages.txt

check-cluster: deps-cluster $(PROGRAMS) ## shared work on a real Slurm of this machine, and by workers that are killed; needs root
	SST_BUILD=$(BUILD) tests/cluster/slurm.sh
	SST_BUILD=$(BUILD) tests/cluster/kills.sh

.PHONY: check-python
check-python: $(PROGRAMS) $(BUILD)/tests/tools/record_writer ## notebooks whole, and python3-sst on public light fields, about 2 minutes; SHARED=DIR has their folder
	SST_BUILD=$(BUILD) tests/python/check.sh $(SHARED)

.PHONY: deps-packages packages check-packages check-packages-quick
DIST ?= bookworm
deps-packages: ## install what packages and check-packages need besides
	scripts/deps.sh scripts/packages/packages.txt

packages: ## Debian packages in build/packages/DIST/, built in a clean root: DIST=bookworm (default) or trixie, PACKAGES_ARCH=arm64; needs root
	scripts/packages/build.sh $(DIST) $(PACKAGES_ARCH)

check-packages: ## lintian, piuparts, autopkgtest, second build, first live picture of the packages of DIST; ONLY="lintian first"; needs root
	scripts/packages/check.sh $(DIST) $(ONLY)

check-packages-quick: $(PROGRAMS) ## debian/ against what make install puts where; part of make check
	SST_BUILD=$(BUILD) tests/system/packages.sh

deps-colmap: ## install what check-colmap needs besides
	scripts/deps.sh scripts/colmap/packages.txt

check-colmap: deps-colmap $(BUILD)/sst ## exports triangulated by Debian's COLMAP, against the truth of their depths
	SST_BUILD=$(BUILD) tests/colmap/check.sh

check-onvif: $(PROGRAMS) ## foreign clients (npm, Debian) on sst-onvif, in a network of its own; downloads them; needs root, node and npm
	SST_BUILD=$(BUILD) tests/onvif/check.sh

check-genicam: $(PROGRAMS) ## fake GigE cameras in network namespaces, packets lost, a cable cut, beside V4L2 ones; MINUTES=10 CAMERAS=16; needs root
	SST_BUILD=$(BUILD) tests/genicam/check.sh

check-law: $(PROGRAMS) ## reuse on the tree, the bill of materials against CycloneDX's schema, whole releases; installs and downloads both; needs npm
	SST_BUILD=$(BUILD) tests/law/check.sh

check-nodes: $(PROGRAMS) $(TOOLS) ## nodes and a head in network namespaces, on a bad network, nodes killed; MINUTES=30 NODES=2; needs root
	SST_BUILD=$(BUILD) tests/nodes/check.sh

check-scale: $(PROGRAMS) ## a hundred cameras on four nodes and a head in network namespaces, recorded; MINUTES=10 RATE=30; needs root
	SST_BUILD=$(BUILD) tests/scale/check.sh

deps-kernel: ## install what check-kernel needs besides
	scripts/deps.sh scripts/kernel/packages.txt

check-kernel: $(BUILD)/sst $(PLUGINS) $(GUEST_TESTS) ## boot a stock Debian kernel in an emulator and test on its devices; GUEST=name for one test
	SST_BUILD=$(BUILD) scripts/kernel/check.sh $(GUEST)

# Statement and branch coverage by all tests but those that measure time; per folder to build-coverage/coverage.txt.
coverage: deps ## measure which lines and branches the tests run, about a quarter of an hour
	rm -rf build-coverage && mkdir build-coverage
	$(MAKE) $(PARALLEL) BUILD=build-coverage OPT='-O1 -g1' CFLAGS='--coverage -fprofile-update=atomic' CXXFLAGS=--coverage LDFLAGS=--coverage built build-coverage/api_tables
	-SST_BUILD=build-coverage SST_TEST_SMALL=1 scripts/run_tests.sh $(TESTS:$(BUILD)/%=build-coverage/%) $(SYSTEM_TESTS)
	$(PYTHON) scripts/coverage.py build-coverage | tee build-coverage/coverage.txt

# Targets of tests/fuzz, twice: with the sanitized tests' objects and a driver of our own, which `make check` runs, and with
# clang's libFuzzer, which is led by coverage and is for long runs: what it found is kept in build/fuzz/.
FUZZERS := $(patsubst tests/fuzz/%.c,%,$(filter-out tests/fuzz/driver.c,$(wildcard tests/fuzz/*.c)))
FUZZ_MAIN ?= $(BUILD)/obj/tests/fuzz/driver.o
FUZZ_SECONDS ?= $(if $(filter command line,$(origin HOURS)),$(shell expr $(HOURS) '*' 3600 / $(words $(FUZZERS))),60)
$(BUILD)/tests/fuzz/%: $(BUILD)/obj/tests/fuzz/%.o $(FUZZ_MAIN) $(BUILD)/libsst-sim.a $(BUILD)/libsst.a
	@mkdir -p $(@D)
	@$(CC) $(LDFLAGS_ALL) $^ $(LIBS) -o $@
fuzzers: $(FUZZERS:%=$(BUILD)/tests/fuzz/%)
fuzz: ## look for inputs that crash, leak or hang the readers of files and messages: FUZZ_SECONDS=60 for each, or HOURS= for all
	$(MAKE) $(PARALLEL) CC=clang CXX=clang++ BUILD=build-fuzz SAN=address,undefined CFLAGS=-fsanitize=fuzzer-no-link,null,pointer-overflow LDFLAGS=-fsanitize=fuzzer FUZZ_MAIN= fuzzers
	@for f in $(FUZZERS); do mkdir -p build/fuzz/corpus-$$f; \
	  FUZZ_CORPUS=build/fuzz/corpus-$$f build-fuzz/tests/fuzz/$$f -close_fd_mask=2 -max_len=65536 -malloc_limit_mb=512 -rss_limit_mb=2048 -timeout=120 \
	    -max_total_time=$(FUZZ_SECONDS) -artifact_prefix=build/fuzz/$$f- build/fuzz/corpus-$$f $(wildcard tests/fuzz/corpus/$$f) || exit 1; \
	done

# Each header compiles alone; those that a .c includes several times with other macros (templates) do not.
# Headers of optional parts come with what they are built with.
HEADERS := $(filter-out $(if $(filter 1,$(WITH_RTSP)),,publishers/rtsp/%) $(if $(filter 1,$(WITH_DNNL)),,%_dnnl.h) $(if $(filter 1,$(WITH_TIFF)),,%_tiff.h) %_tmpl.h %/templates.h,$(wildcard $(foreach d,base client config read drivers capture pipeline daemon publishers cli simulators tests,$(d)/*.h $(d)/*/*.h $(d)/*/*/*.h $(d)/*/*/*/*.h)))
$(BUILD)/headers/%.h.ok: %.h | $(BUILD)/shaders.h
	@mkdir -p $(@D)
	@echo '#include "$<"' | $(CC) -std=c11 -D_DEFAULT_SOURCE -I. -I$(BUILD) $(if $(filter publishers/rtsp/%,$<),$(subst -I,-isystem ,$(shell $(PKG_CONFIG) --cflags $(PACKAGES_rtsp)))) -Wall -Werror -fsyntax-only -MMD -MP -MT $@ -MF $(@:.ok=.d) -x c -
	@touch $@
check-includes: $(HEADERS:%=$(BUILD)/headers/%.ok) ## headers compile alone, includes go one way
	scripts/check_includes.sh
check-words: ## comments name things: stand-ins for nouns are counted, in changed lines and in all; part of check-names
	$(PYTHON) scripts/check_words.py
check-structure: ## functions of many parameters or lines, long headers and circles of files are within limits; part of check-names
	$(PYTHON) scripts/structure.py
check-names: check-words check-structure
check-names: $(LIB_OBJ) $(BUILD)/obj/read/read.o $(SHIM_OBJ) $(CLI_OBJ) $(WORLD_OBJ) $(SIM_OBJ) $(PUBLISHERS:%=$(BUILD)/sst-%) $(BUILD)/sstd ## names say which folder they belong to, links go one way
	SST_BUILD=$(BUILD) scripts/check_names.sh

BENCH := $(BUILD)/sst $(BUILD)/bench/peaks $(BUILD)/bench/live_frames $(BUILD)/bench/live_clear $(BUILD)/bench/live_scene $(BUILD)/bench/network \
  $(if $(filter 1,$(WITH_OPENCV)),$(BUILD)/bench/stereo $(BUILD)/bench/render $(BUILD)/bench/rectify $(BUILD)/bench/posed)
bench: $(BENCH) ## measure time against error at both levels, about 30 minutes; renews docs/measured/bench-*, time-error-*, skips-*, roofline.*, figures of README
	$(PYTHON) scripts/bench.py --build $(BUILD)
bench-quick: $(BENCH) ## the same in 5 minutes with small pictures; stays in build/bench-quick/
	$(PYTHON) scripts/bench.py --build $(BUILD) --quick

BENCH_NETWORKS := $(BUILD)/sst $(BUILD)/bench/network $(BUILD)/bench/features
bench-networks: $(BENCH_NETWORKS) ## measure the networks, time and errors; renews docs/measured/bench-{labels,matching,runner}.md
	$(PYTHON) scripts/bench_labels.py --build $(BUILD)
	$(PYTHON) scripts/bench_runner.py --build $(BUILD)
	$(PYTHON) scripts/bench_matching.py --build $(BUILD)

bench-check: $(BUILD)/sst $(BUILD)/bench/check ## name the stages that became more than 10 % slower than docs/measured/bench-check.json
	$(PYTHON) scripts/bench_check.py --build $(BUILD)
bench-check-update: $(BUILD)/sst $(BUILD)/bench/check ## make today's times the baseline of this machine
	$(PYTHON) scripts/bench_check.py --build $(BUILD) --update

.PHONY: bounds soak-chain
bounds: $(BUILD)/tests/kernels/bounds $(BUILD)/tests/unit/bounds $(BUILD)/tests/unit/degenerate ## list the largest errors beside their bounds: docs/measured/bounds.md
	$(PYTHON) scripts/bounds.py --build $(BUILD)
# As many processes as processors, from different seeds; what they did stands in the last line. With floating-point traps and sanitizers:
# SAN=address,undefined, a second for a chain; SAN=undefined OPT='-O2 -g1', a twentieth of that.
HOURS ?= 1
SEED ?= $(shell date +%s)000
soak-chain: $(BUILD)/tests/tools/chain ## HOURS=1 of random chains from SEED on (the clock by default); a failure prints its seed
	scripts/soak_chain.sh $(BUILD)/tests/tools/chain $(HOURS) $(SEED)

SOAK ?= 30
bench-service: all ## measure the service on simulated arrays, about 10 minutes; renews docs/measured/bench-service.md
	$(PYTHON) scripts/bench_service.py --build $(BUILD)
soak-service: all ## SOAK=30 minutes of faults; reports the slope of memory
	$(PYTHON) scripts/bench_service.py --build $(BUILD) --soak $(SOAK)

BENCH_GPU := $(BUILD)/sst $(BUILD)/bench/device_limits $(BUILD)/bench/device_sgm $(BUILD)/bench/raw_frames \
  $(if $(filter 1,$(WITH_DNNL)),$(BUILD)/bench/network_device)
bench-gpu: $(BENCH_GPU) ## measure every stage on every device against the CPU; renews docs/measured/gpu.md
	$(PYTHON) scripts/bench_gpu.py --build $(BUILD)
bench-posed: $(BUILD)/sst ## measure posed light fields, about 4 minutes: ARRAYS=DIR and THERMAL=DIR add public pictures; renews docs/measured/bench-posed.md
	$(PYTHON) scripts/bench_posed.py --build $(BUILD) $(if $(ARRAYS),--arrays $(ARRAYS)) $(if $(THERMAL),--thermal $(THERMAL))
bench-perturb: $(BUILD)/sst ## measure error against what is wrong with the pictures, an hour; renews docs/measured/bench-perturb.*
	$(PYTHON) scripts/bench_perturb.py --build $(BUILD)

BENCH_CALIB := $(BUILD)/bench/calib $(BUILD)/bench/calib_pairs
bench-calib: $(BENCH_CALIB) ## measure calibration against known truth, about 8 minutes; renews docs/measured/bench-calibration.md
	$(PYTHON) scripts/bench_calib.py --build $(BUILD)

bench-watch: $(BUILD)/bench/watch ## measure detection behind simulated foliage, about 5 minutes; renews docs/measured/bench-watch.md
	$(PYTHON) scripts/bench_watch.py --build $(BUILD) --fresh

# What deps installs changes what the build finds, hence the second make.
demo: deps ## see through moving scenes: simulated arrays, the service, its page; DEMO=--once: pictures in sst-demo/, and the end
	$(MAKE) all
	$(BUILD)/sst demo $(DEMO)

UNITDIR ?= $(PREFIX)/lib/systemd/system
UDEVDIR ?= $(PREFIX)/lib/udev
ZSHDIR ?= $(PREFIX)/share/zsh/site-functions
RUN_INSTALL := BUILD='$(BUILD)' PREFIX='$(PREFIX)' SYSCONFDIR='$(SYSCONFDIR)' DESTDIR='$(DESTDIR)' PLUGINDIR='$(PLUGINDIR)' UNITDIR='$(UNITDIR)' \
  UDEVDIR='$(UDEVDIR)' ZSHDIR='$(ZSHDIR)' scripts/install.sh
install install-built uninstall: export READ_DIRS = LIBDIR='$(LIBDIR)' INCLUDEDIR='$(INCLUDEDIR)' VERSION='$(VERSION)'
install: all ## install programs, units, rules, man pages under DESTDIR/PREFIX; then docs/use/install.md
	$(RUN_INSTALL) install
install-built: ## the same without building
	$(RUN_INSTALL) install
uninstall: ## remove what install put there, changed configuration excepted
	$(RUN_INSTALL) uninstall

man: $(BUILD)/sst $(BUILD)/api_tables ## write man pages, completions, openapi.json and status.md from their tables
	scripts/man.py --build $(BUILD)
	scripts/config_man.py --build $(BUILD)
	scripts/openapi.py --build $(BUILD)

.PHONY: check-docs check-spdx api-index release-check release sbom
sbom: all ## bill of materials of the build: build/sst.cdx.json (docs/design/release.md)
	scripts/evidence.py sbom --build $(BUILD) -o $(BUILD)/sst.cdx.json
	@echo $(BUILD)/sst.cdx.json
release: all ## source archive, bill of materials, provenance, hashes, signed tag: build/release (docs/design/release.md)
	scripts/release.sh $(BUILD)
release-check: ## version, changelog, man pages and docs name one release
	scripts/release_check.sh
check-docs: ## links, citations and names in the docs resolve; part of check-includes
	$(PYTHON) scripts/check_docs.py
check-spdx: ## each file has copyright and licence; part of check-includes
	$(PYTHON) scripts/spdx.py
check-includes: check-docs check-spdx

api-index: ## list all public headers with their purpose lines
	@scripts/api_index.sh

format: ## lay out the sources by .clang-format
	clang-format -i $$(git ls-files '*.c' '*.h' '*.cc')

help: ## this list
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/' | expand -t 16

clean: ## remove what was built
	rm -rf build build-*

-include $(LIB_OBJ:.o=.d) $(BUILD)/obj/read/read.d $(SHIM_OBJ:.o=.d) $(VIDEO_OBJ:.o=.d) $(BUILD)/obj/drivers/still/lib_gphoto.d $(BUILD)/obj/drivers/genicam/lib_aravis.d $(WORLD_OBJ:.o=.d) $(DRAWN_OBJ:.o=.d) $(BUILD)/obj/daemon/main.d $(BUILD)/obj/scripts/api_tables.d $(SIM_OBJ:.o=.d) $(CLI_OBJ:.o=.d) $(TEST_SRC:%.c=$(BUILD)/obj/%.d) $(patsubst %.c,$(BUILD)/obj/%.d,$(wildcard tests/guest/*.c tests/tools/*.c tests/fuzz/*.c)) $(wildcard $(BUILD)/obj/tests/bench/*.d) $(HEADERS:%=$(BUILD)/headers/%.d)
