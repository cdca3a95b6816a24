//! Converters of the processor: photodiode, pickoff and two thermometers in, path-length actuator and discharge current out.
//!
//! ```text
//! TIM4, the tick ─▶ ADC1, four injected channels, 18 µs ─▶ interrupt of the tick
//! PC0 photodiode, PC1 pickoff, PC2 and PC3 thermometers          12 bits each
//! PA4 DAC: path-length actuator, code 0 to 4095                  PA8, pulse width of TIM1: discharge current, code 0 to 4095
//! ```
//!
//! 12 bits over a range of 165 °C are 0.04 °C a code, and the rate of change needs a thousandth of a degree. They serve a board on a desk;
//! a gyro has an external converter of 24 bits on SPI, read by a DMA, in [`Desk::sample`].

use core::convert::Infallible;

use embedded_hal::pwm::{ErrorType, SetDutyCycle};
use sagnac_board::{ActuatorCodes, Converters, PwmOutput, Sample};
use sagnac_core::Status;
use stm32f4::stm32f407::{ADC_COMMON, ADC1, DAC, GPIOA, GPIOC, RCC, TIM1};

/// Highest code of both outputs.
const HIGHEST: i32 = 4095;

/// The converters in use.
pub struct Desk {
    inputs: ADC1,
    actuator: DAC,
    current: PwmOutput<Lamp>,
}

/// The pulse width that sets the discharge current.
struct Lamp(TIM1);

impl ErrorType for Lamp {
    type Error = Infallible;
}

impl SetDutyCycle for Lamp {
    fn max_duty_cycle(&self) -> u16 {
        HIGHEST as u16
    }

    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
        // SAFETY: any 16 bits are a width of this channel.
        self.0.ccr1().write(|w| unsafe { w.bits(duty.into()) });
        Ok(())
    }
}

/// What the converters are made of.
pub struct Parts<'a> {
    pub rcc: &'a RCC,
    pub port_a: &'a GPIOA,
    pub port_c: &'a GPIOC,
    pub common: &'a ADC_COMMON,
}

impl Desk {
    /// Sets the converters up, with both outputs at their lowest code.
    pub fn start(parts: &Parts<'_>, inputs: ADC1, actuator: DAC, lamp: TIM1) -> Option<Self> {
        parts.rcc.ahb1enr().modify(|_, w| w.gpioaen().enabled().gpiocen().enabled());
        parts.rcc.apb1enr().modify(|_, w| w.dacen().enabled());
        parts.rcc.apb2enr().modify(|_, w| w.adc1en().enabled().tim1en().enabled());
        let (analog, pins) = (parts.port_c, parts.port_a);
        analog.moder().modify(|_, w| w.moder0().analog().moder1().analog().moder2().analog().moder3().analog());
        pins.moder().modify(|_, w| w.moder4().analog().moder8().alternate());
        pins.afrh().modify(|_, w| w.afrh8().af1());

        // 84 MHz / 4; 84 clocks of sampling and 12 of conversion for each channel.
        parts.common.ccr().modify(|_, w| w.adcpre().div4());
        inputs.smpr1().write(|w| w.smp10().cycles84().smp11().cycles84().smp12().cycles84().smp13().cycles84());
        // SAFETY: channels 10 to 13 of 18, and a length of four.
        inputs
            .jsqr()
            .write(|w| unsafe { w.jl().bits(3).jsq1().bits(10).jsq2().bits(11).jsq3().bits(12).jsq4().bits(13) });
        inputs.cr1().write(|w| w.scan().enabled().jeocie().enabled());
        inputs.cr2().write(|w| w.jextsel().tim4trgo().jexten().rising_edge().adon().enabled());

        actuator.cr().write(|w| w.en1().enabled());
        lamp.arr().write(|w| w.arr().set(HIGHEST as u16));
        lamp.ccmr1_output().write(|w| w.oc1m().pwm_mode1().oc1pe().enabled());
        lamp.ccer().write(|w| w.cc1e().set_bit());
        lamp.bdtr().write(|w| w.moe().enabled());
        lamp.cr1().write(|w| w.arpe().enabled().cen().enabled());
        Some(Self { inputs, actuator, current: PwmOutput::new(Lamp(lamp), 0, HIGHEST)? })
    }

    /// The interrupt of the four samples is over.
    pub fn acknowledge(&self) {
        self.inputs.sr().modify(|_, w| w.jeoc().clear_bit().jstrt().clear_bit());
    }
}

impl Converters for Desk {
    fn sample(&mut self) -> Sample {
        let inputs = &self.inputs;
        let thermometers =
            [inputs.jdr3().read().jdata().bits(), inputs.jdr4().read().jdata().bits()].map(|code| Some(code.into()));
        Sample {
            codes: [thermometers[0], thermometers[1], None, None],
            // The middle of the range is the middle of the dither.
            pickoff: i32::from(inputs.jdr2().read().jdata().bits()) - 2048,
            light: inputs.jdr1().read().jdata().bits().into(),
            status: Status::OK,
        }
    }

    fn drive(&mut self, codes: &ActuatorCodes) {
        let code = codes.actuator.clamp(0, HIGHEST) as u16;
        // SAFETY: 12 bits.
        self.actuator.dhr12r1().write(|w| unsafe { w.daccdhr().bits(code) });
        let Ok(()) = self.current.set(codes.current);
    }
}
