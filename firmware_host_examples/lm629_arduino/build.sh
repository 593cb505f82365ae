#!/bin/sh
# Builds the sketch for an Uno with avr-gcc and Debian's arduino-core-avr: sh build.sh OUTPUT.elf
set -e
core=${ARDUINO_AVR:-/usr/share/arduino/hardware/arduino/avr}
here=$(dirname "$0")
made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT
# gcc 5.4 lacks a macro of <float.h> that WString.cpp wants.
flags="-mmcu=atmega328p -DF_CPU=16000000L -DARDUINO=10819 -DARDUINO_AVR_UNO -DARDUINO_ARCH_AVR
       -DDECIMAL_DIG=9 -Os -w -ffunction-sections -fdata-sections
       -I$core/cores/arduino -I$core/variants/standard -I$here/Lm629"
cxx="-std=gnu++11 -fpermissive -fno-exceptions -fno-threadsafe-statics"
for file in "$core"/cores/arduino/*.c; do
    avr-gcc $flags -std=gnu11 -c -o "$made/$(basename "$file").o" "$file"
done
for file in "$core"/cores/arduino/*.cpp "$here"/Lm629/*.cpp; do
    avr-g++ $flags $cxx -c -o "$made/$(basename "$file").o" "$file"
done
for file in "$core"/cores/arduino/*.S; do
    avr-gcc $flags -x assembler-with-cpp -c -o "$made/$(basename "$file").o" "$file"
done
avr-g++ $flags $cxx -include Arduino.h -x c++ -c -o "$made/sketch.o" "$here/TwoAxes/TwoAxes.ino"
avr-gcc -mmcu=atmega328p -Os -Wl,--gc-sections -o "$1" "$made"/*.o -lm
