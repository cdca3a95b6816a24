//! Vector files: any text is read or refused, and what it asks for is run.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    // A record may ask for 2^32 ticks; runs are cut to what a fuzzer has time for by taking the digits away.
    let text: Vec<u8> = bytes.iter().copied().filter(|byte| byte.is_ascii()).collect();
    let mut words = sagnac_vectors::Words::new(&text);
    let Ok(head) = words.head() else { return };
    let mut room = [0; sagnac_vectors::MAX_TABLE];
    let Ok(table) = words.table(&head, &mut room) else { return };
    let Some(mut machine) = sagnac_vectors::Machine::new(head.module, table) else { return };
    while let Ok([operation, ticks, rest @ ..]) = words.record() {
        let mut inputs = [0; sagnac_vectors::INPUTS];
        inputs.iter_mut().zip([ticks % 300].iter().chain(&rest)).for_each(|(slot, word)| *slot = *word);
        let _ = machine.step(operation, &inputs);
    }
});
